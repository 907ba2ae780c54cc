"""Features of a user's own: one function each, which specs, signatures, packings and policies know by name."""

import pytest
import torch

from tests.conftest import small_world
from warp_torchrl.algorithms.ppo import Ppo
from warp_torchrl.entries import Empty, Part
from warp_torchrl.env import WildfireEnv
from warp_torchrl.env.observation import (
    PICTURE,
    STATE,
    STATE_SIDE,
    STATUS,
    Local,
    Surroundings,
    number,
    picture_channel,
    state_plane,
)
from warp_torchrl.models import ACTION, OBSERVATION, Mlp, differing, signature
from warp_torchrl.models.packing import packing_of
from warp_torchrl.runs.policies.trained import TrainedPolicy
from warp_torchrl.world.arrays.blocks import block_means

OWN = (*OBSERVATION, "status")
DRY = 99
"""Horizon of the worlds that the tests take to be dry."""


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


@pytest.fixture
def mud():
    """A channel of the picture and a plane of the state of one name: the share that is wet, which dry worlds lack."""

    def held(world, names):
        return Empty() if world.horizon == DRY else None

    @picture_channel(high=100, content=held)
    def mud(now):
        return now.show(block_means(now.state.wet > 0, now.side), 100)

    shown = mud

    @state_plane(content=held)
    def mud(now):
        return block_means(now.state.wet > 0, STATE_SIDE)

    assert shown is PICTURE["mud"].show
    yield "mud"
    del PICTURE["mud"], STATE["mud"]


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


def wet(env):
    """Start worlds, wet the trees of the first row, and return what is shown then."""
    env.reset()
    state = env.world_state
    ticks = torch.zeros_like(state.wet)
    ticks[:, 0] = 3
    return env.set_state(state.replace(wet=ticks))


@pytest.mark.parametrize("options", [{}, {"centred": False}, {"near": 2}], ids=str)
def test_a_channel_of_ones_own_stands_in_every_picture(mud, options):
    plain, env = env_of(**options), env_of(mud, **options)
    before, now = plain.reset()[OBSERVATION], wet(env)[OBSERVATION]
    for name in ("picture", "near") if "near" in options else ("picture",):
        spec, entry = env.observation_spec[(*OBSERVATION, name)], signature(env).observation[name]
        assert entry.names == (*signature(plain).observation[name].names, "mud") == env.channel_names[name]
        assert entry.symmetry.target == signature(plain).observation[name].symmetry.target
        assert torch.equal(now[name][:, :, :-1], before[name]) and now[name].dtype == spec.dtype
        high = 1.0 if now[name].is_floating_point() else 100
        assert spec.high[0, 0, -1].max() == high >= now[name][:, :, -1].max() > 0
    assert torch.equal(policy_of(plain).fitted(env)(env.reset())[ACTION], policy_of(plain)(plain.reset())[ACTION])
    with pytest.raises(ValueError, match=r"trained to see mud in .*, which this environment does not show"):
        policy_of(env).fitted(plain)


def test_a_plane_of_ones_own_stands_before_the_clock_of_the_state(mud):
    plain, env = env_of(preset=Local), env_of(mud, preset=Local)
    assert env.state_names == (*plain.state_names[:-1], "mud", "clock_and_wind")
    assert env.state_symmetry == plain.state_symmetry._replace(channels=len(env.state_names))
    before, seen = plain.reset()["state"], wet(env)["state"]
    assert seen.shape == env.observation_spec["state"].shape
    assert torch.equal(seen[:, [*range(len(plain.state_names) - 1), -1]], before)
    assert torch.equal(seen[:, -2], block_means(env.world_state.wet > 0, STATE_SIDE)) and seen[:, -2].any()
    assert differing(signature(plain), signature(env)) == "state"


def test_a_number_of_each_world_fills_its_plane():
    @state_plane()
    def steps(now):
        return now.state.step / 64.0

    try:
        env = env_of("steps", preset=Local)
        seen = env.step(env.rand_action(env.reset()))["next", "state"]
        assert (seen[:, -2] == 1.0 / 64.0).all()
    finally:
        del STATE["steps"]


@pytest.mark.parametrize("read", [lambda shape: shape.observation["picture"], lambda shape: shape.state])
def test_what_a_world_does_not_fill_is_left_out_of_products(mud, read):
    def entry_of(*features, horizon):
        world = small_world(horizon=horizon)
        return read(signature(WildfireEnv(world, observation=Surroundings(features=features), n_worlds=1)))

    def numbers(entry):
        packing, whole = packing_of(entry), torch.zeros(entry.shape)
        return whole.numel() if packing is None else packing.packed(whole).numel()

    plain, full, dry = entry_of(horizon=98), entry_of(mud, horizon=98), entry_of(mud, horizon=DRY)
    assert dry.content[dry.names.index("mud")] == Empty() and full.bare() == dry.bare()
    assert numbers(dry) == numbers(plain) == numbers(full) - plain.shape[-1] ** 2


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
