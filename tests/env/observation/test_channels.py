"""Channels by name: chosen, added, and what a policy that knows fewer makes of them."""

import pytest
import torch

from tests.conftest import small_world
from warp_torchrl import make_env
from warp_torchrl.algorithms.ppo import Ppo
from warp_torchrl.env import WildfireEnv
from warp_torchrl.env.observation import CHANNELS, DEFAULT, Local, Surroundings, channel
from warp_torchrl.models import ACTION, ACTION_MASK, OBSERVATION, Mlp, signature
from warp_torchrl.runs.policies.trained import TrainedPolicy
from warp_torchrl.world.team.team import Team


@pytest.fixture
def wetland():
    """A channel of a user's own."""

    @channel(high=200)
    def wetland(look):
        return (look.window.of(look.state.cover) == 1) * 200

    yield "wetland"
    del CHANNELS["wetland"]


def seen_with(*names, **team):
    world, observation = small_world(team=Team(n_agents=3, **team)), Local(radius=2, channels=names)
    env = WildfireEnv(world, observation=observation, n_worlds=2)
    return env, env.reset()


def test_a_view_has_the_channels_that_are_chosen_in_their_order():
    _, whole = seen_with(*DEFAULT)
    _, few = seen_with("threat", "age")
    view, part = whole[(*OBSERVATION, "view")], few[(*OBSERVATION, "view")]
    assert torch.equal(part, view[:, :, [DEFAULT.index("threat"), DEFAULT.index("age")]]) and part.any()


def test_a_channel_of_ones_own_stands_beside_the_others(wetland):
    env, now = seen_with(*DEFAULT, wetland)
    view = now[(*OBSERVATION, "view")]
    assert view.dtype == torch.uint8 and env.channel_names["view"][-1] == "wetland"
    row, column = env.world_state.vehicles.position[0, 0].tolist()
    assert (view[0, 0, -1, 2, 2] == 200) == (env.world_state.cover[0, row, column] == 1)
    assert set(view[:, :, -1].unique().tolist()) <= {0, 200}
    assert env.observation_spec[(*OBSERVATION, "view")].high[0, 0, -1].max() == 200
    made = make_env("single", n_worlds=1, overrides=["observation.channels=[age,wetland]"])
    assert made.channel_names["view"] == ("age", "wetland")


@pytest.mark.parametrize("names", [(), ("age", "age"), ("age", "smoke")])
def test_channels_that_are_not_there_are_refused(names):
    with pytest.raises(ValueError, match=r"channels must be a list of different names of off_map, .*, got"):
        Surroundings(channels=names)


def test_a_name_that_is_taken_is_refused():
    line = r"age must be a new channel's name, warp_torchrl\.env\.observation\.channels has"
    with pytest.raises(ValueError, match=line):

        @channel()
        def age(look):
            return look.cells


@pytest.mark.parametrize("symmetry", ["none", "canonical"])
def test_a_policy_plays_beside_channels_and_actions_that_it_does_not_know(wetland, symmetry):
    there, _ = seen_with(*DEFAULT, allow_stay=False)
    torch.manual_seed(0)
    policy = TrainedPolicy(Ppo().policy(signature(there), Mlp(symmetry=symmetry)), "deterministic", signature(there))
    assert policy.fitted(there).module is policy.module
    here, now = seen_with(wetland, *reversed(DEFAULT))
    alike = now.clone()
    alike[(*OBSERVATION, "view")] = now[(*OBSERVATION, "view")].flip(2)[:, :, :-1]
    alike[ACTION_MASK] = now[ACTION_MASK][..., :-1]
    adapted = policy.fitted(here)
    assert torch.equal(adapted(now.clone())[ACTION], policy(alike)[ACTION])
    shut = now.clone()
    shut[ACTION_MASK] = torch.zeros_like(now[ACTION_MASK])
    assert (adapted(shut)[ACTION] == 8).all(), "what does nothing is to put out a fire that is not there"


def test_what_a_policy_lacks_is_told_by_name():
    there, _ = seen_with(*DEFAULT)
    policy = TrainedPolicy(Ppo().policy(signature(there), Mlp()), "sampled", signature(there))
    with pytest.raises(ValueError, match="trained to see age, threat in view, which this environment does not show"):
        policy.fitted(seen_with(*(name for name in DEFAULT if name not in ("age", "threat")))[0])
    with pytest.raises(ValueError, match="trained with 11 actions, this environment has 10: stay"):
        policy.fitted(seen_with(*DEFAULT, allow_stay=False)[0])
    wider = WildfireEnv(small_world(), observation=Local(radius=3), n_worlds=1)
    with pytest.raises(ValueError, match=r"trained on view \[11, 5, 5\] uint8, this environment shows \[11, 7, 7\]"):
        policy.fitted(wider)


def test_canonical_inputs_take_a_channel_that_shows_fire():
    env, _ = seen_with("age", "threat")
    with pytest.raises(ValueError, match=r"model\.symmetry must be none where no entry shows a target, such as fire"):
        Ppo().policy(signature(env), Mlp())


def test_ash_and_firebreaks_are_shown_where_they_are_and_not_beyond_the_map():
    env, _ = seen_with("ash", "firebreak", "off_map")
    state = env.world_state
    position = torch.zeros_like(state.vehicles.position)  # in the corner: five by five cells, of which nine are there
    flags = torch.zeros_like(state.burned)
    marked = [flags.clone() for _ in range(2)]
    marked[0][:, 0, 1], marked[1][:, 1, 0] = True, True
    cells = torch.where(marked[0] | marked[1], 0, 5).to(torch.uint8)
    state = state.replace(
        cells=cells, burned=marked[0], firebreak=marked[1], vehicles=state.vehicles.replace(position=position)
    )
    ash, firebreak, off_map = env.set_state(state)[(*OBSERVATION, "view")][0, 0]
    assert ash.nonzero().tolist() == [[2, 3]] and firebreak.nonzero().tolist() == [[3, 2]]
    assert (off_map == 255).sum() == 16
