"""Features of a user's own: one function each, which specs, signatures, packings and policies know by name."""

import pytest
import torch

from tests.conftest import small_world
from warp_torchrl.algorithms.ppo import Ppo
from warp_torchrl.entries import Part
from warp_torchrl.env import WildfireEnv
from warp_torchrl.env.observation import STATUS, Local, Surroundings, number
from warp_torchrl.models import ACTION, OBSERVATION, Mlp, differing, signature
from warp_torchrl.runs.policies.trained import TrainedPolicy

OWN = (*OBSERVATION, "status")


@pytest.fixture
def heading():
    """Numbers of a user's own: the way to the middle of the map, and the share of the team's acts."""

    @number([Part("vector", ("middle_east", "middle_north")), Part("scalar", ("share_of_acts",))])
    def heading(now):
        height, width = now.state.cells.shape[1:]
        row, column = now.state.vehicles.position.unbind(-1)
        acts = now.state.vehicles.acts
        share = acts / acts.sum(dim=1, keepdim=True).clamp(min=1)
        return torch.stack((0.5 - column / width, row / height - 0.5, share), dim=-1)

    yield "heading"
    del STATUS["heading"]


def env_of(*features, preset=Surroundings, **options):
    return WildfireEnv(small_world(), observation=preset(features=features, **options), n_worlds=3)


def policy_of(env):
    torch.manual_seed(0)
    return TrainedPolicy(Ppo().policy(signature(env), Mlp()), "deterministic", signature(env))


def test_a_number_of_ones_own_comes_last_by_name_and_turns_as_it_says(heading):
    plain, env = env_of(), env_of(heading)
    before, now = signature(plain).observation["status"], signature(env).observation["status"]
    names = ("middle_east", "middle_north", "share_of_acts")
    assert now.names == (*before.names, *names) and now.shape == (before.shape[0] + 3,)
    assert env.observation_spec[OWN].shape[-1] == now.shape[0]
    assert now.symmetry.parts == (*before.symmetry.parts, Part("vector", names[:2]), Part("scalar", names[2:]))
    seen = env.reset()[OWN]
    place = dict(zip(now.names, seen.unbind(-1)))
    assert torch.equal(seen[..., :-3], plain.reset()[OWN]) and seen.shape == (3, env.n_agents, *now.shape)
    width = env.world.size[1]
    torch.testing.assert_close(place["middle_east"], 0.5 - place["column"] * (width - 1) / width)


def test_a_policy_of_before_plays_beside_it_and_one_that_knows_it_needs_it(heading):
    plain, env = env_of(), env_of(heading)
    assert differing(signature(plain), signature(env)) == "observation status", "a run goes on with its own alone"
    before, now = policy_of(plain), env.reset()
    assert torch.equal(before.fitted(env)(now.clone())[ACTION], before(plain.reset())[ACTION])
    line = "trained to see middle_east, middle_north, share_of_acts in status, which this environment does not show"
    with pytest.raises(ValueError, match=line):
        policy_of(env).fitted(plain)


@pytest.mark.parametrize("names", [("slope",), ("heading", "heading"), ("tank",)])
def test_features_that_are_not_there_to_choose_are_refused(heading, names):
    with pytest.raises(ValueError, match=r"features must be a list of different names of .*heading.*, got"):
        Local(features=names)


def test_two_numbers_of_one_name_are_refused(heading):
    @number([Part("scalar", ("row",))])
    def my_row(now):
        return now.state.vehicles.position[..., 0] / 100.0

    try:
        with pytest.raises(ValueError, match="features of an entry must have different names, got row twice"):
            Local(features=("my_row",)).spaces(small_world())
    finally:
        del STATUS["my_row"]


def test_a_name_of_another_module_is_refused():
    with pytest.raises(ValueError, match=r"tank must be a new number of status's name, warp_torchrl.*status has one"):

        @number()
        def tank(now):
            return now.state.vehicles.tank
