"""The planner by hand, and what it may not know."""

from dataclasses import replace

import pytest
import torch
from torch import Tensor

from tests.env.scenarios import FURTHER, MECHANICS, OF_MECHANICS
from tests.heuristics.drawing import scene
from tests.world.drawing import differing
from tests.world.mechanics.there import can_play
from warp_torchrl import make_env
from warp_torchrl.env import WildfireEnv
from warp_torchrl.heuristics import Dispatch, Rollout
from warp_torchrl.world.arrays import random
from warp_torchrl.world.state.state import Action, WorldState

# The fire in the west has no neighbours; that in the middle ignites trees for certain at the next tick.
TWO_FIRES = "a..aTTTT ....TTTT ....TTTT ....TTTT"


class Quick(Rollout):
    """The planner with a short look ahead."""

    horizon, samples = 6, 4


class ByDispatch(Quick):
    """The same over another base policy."""

    base = Dispatch


class InParts(Quick):
    """The same with 20 worlds at once."""

    cells = 20 * 16 * 16


def plan(env: WildfireEnv, state: WorldState, kind: type[Rollout] = Quick) -> Tensor:
    return kind(env).choose(state, env.world.possible_actions(state))


def two_steps_before_the_tick(*at: tuple[int, int]) -> tuple[WildfireEnv, WorldState]:
    env, state = scene(TWO_FIRES, at=list(at))
    env.world = replace(env.world, steps_per_tick=2)
    return env, state


def under_way(scenario: str, *overrides: str) -> tuple[WildfireEnv, WorldState]:
    """Six worlds of a scenario after some steps of the base policy."""
    env = make_env(scenario, n_worlds=6, overrides=["landscape.size=16", "team.n_agents=2", *overrides])
    policy, now = Dispatch(env), env.reset()
    for _ in range(10):
        now = env.step(policy(now))["next"]
    return env, env.world_state


@pytest.mark.parametrize("kind", [Quick, ByDispatch])
def test_it_leaves_the_fire_at_hand_for_one_that_is_about_to_spread(kind: type[Rollout]) -> None:
    # Both are put out in time by going east first: the one in the west burns on by itself.
    env, state = two_steps_before_the_tick((0, 1))
    assert kind.base(env).choose(state, env.world.possible_actions(state)).tolist() == [[Action.EXTINGUISH]]
    assert plan(env, state, kind).tolist() == [[Action.EAST]]


def test_agents_take_what_those_before_them_chose_as_given() -> None:
    # One of the two must go; if neither knew of the other's choice, both would.
    env, state = two_steps_before_the_tick((0, 1), (1, 1))
    assert plan(env, state)[0, 1] == Action.EXTINGUISH and plan(env, state)[0, 0] in (Action.EAST, Action.SOUTH_EAST)


def test_where_nothing_is_gained_agents_act_by_the_base_policy() -> None:
    env, state = scene("aTTTTTTT" + " TTTTTTTT" * 3, at=[(0, 1)])
    assert plan(env, state).tolist() == [[Action.EXTINGUISH]]
    env, state = scene("TTTTT TTTTT TTTTT TTTTT", at=[(0, 2), (1, 4)])
    still = torch.full((1, 2), int(Action.STAY))
    assert torch.equal(plan(env, state, ByDispatch), still)
    done = state.replace(terminated=torch.ones_like(state.terminated))
    assert torch.equal(plan(env, done, ByDispatch), still)


def test_gains_must_be_more_than_a_standard_error() -> None:
    env, _ = scene(TWO_FIRES, at=[(0, 1)])
    # Means 1, 1, 1; standard errors 0, sqrt(4 / 3 / 4) = 0.577, sqrt(12 / 4) = 1.732 of four futures.
    gain = torch.tensor([[1, 1, 1, 1], [2, 0, 2, 0], [4, 0, 0, 0]], dtype=torch.int32)
    assert Quick(env)._sure_gain(gain).tolist() == pytest.approx([1.0, 1 - 3**-0.5, 0.0])


@pytest.mark.parametrize("scenario", ["water", pytest.param("shift", marks=pytest.mark.slow)])
def test_it_plans_for_a_world_as_it_does_for_it_alone(scenario: str) -> None:
    env, state = under_way(scenario)
    together = plan(env, state)
    assert not torch.equal(together, Quick.base(env).choose(state, env.world.possible_actions(state)))
    alone = [plan(env, state[at : at + 1]) for at in range(0, 6, 2)]
    assert torch.equal(together[::2], torch.cat(alone))
    assert torch.equal(together.flip(0), plan(env, state[torch.arange(5, -1, -1)]))


def test_it_plans_in_parts_as_it_does_at_once() -> None:
    env, state = under_way("skirmish")
    assert torch.equal(plan(env, state, InParts), plan(env, state))


def test_planning_changes_nothing() -> None:
    env, state = under_way("skirmish")
    before = state.clone()
    plan(env, state)
    assert differing(env.world_state, before) == []


def test_it_does_not_see_what_the_true_worlds_will_draw(monkeypatch: pytest.MonkeyPatch) -> None:
    env, state = under_way("shift", "team.extinguish_p=0.7")
    action, words, drawn = plan(env, state), random._key_words, []

    def others(key: Tensor, tick: Tensor | int, stream: random.Stream) -> tuple[Tensor, Tensor]:
        true = torch.isin(key, state.key)
        drawn.append((stream, bool(true.any())))
        return words(key + (true & (stream != random.Stream.WIND)), tick, stream)

    ticks = state.replace(step=torch.full_like(state.step, 4))
    before = env.world.step(ticks, action).after
    monkeypatch.setattr(random, "_key_words", others)
    assert {"cells", "air.wind"} <= set(differing(env.world.step(ticks, action).after, before)), "they draw others now"
    drawn.clear()
    assert torch.equal(plan(env, state), action)
    ahead = {stream for stream, _ in drawn}
    assert {random.Stream.FIRE, random.Stream.GUST, random.Stream.ACTION} <= ahead
    assert {stream for stream, true in drawn if true} <= {random.Stream.WIND}, "the prevailing wind alone is known"


def test_imagined_draws_differ_between_steps() -> None:
    key, step = torch.tensor([5, 7]), torch.tensor([3, 3], dtype=torch.int32)
    keys = random.imagined_keys(key, step, 4)
    assert torch.equal(keys[:, :2], random.imagined_keys(key, step, 2))
    every = torch.cat((keys, random.imagined_keys(key, step + 1, 4), key[:, None]), dim=1)
    assert len(every.unique()) == 18


QUICKLY = [("scenario=water", "team.allow_stay=false"), *(FURTHER[name] for name in OF_MECHANICS if name in FURTHER)]
AT_LENGTH = [
    ("scenario=ring",),
    ("scenario=hetero",),
    ("scenario=hazard",),
    ("scenario=smoke", "mechanics.radio.delay=1"),
    ("scenario=lightning",),
    *(each for each in MECHANICS.values() if each not in QUICKLY),
]


@pytest.mark.parametrize(
    "overrides",
    [*QUICKLY, *(pytest.param(each, marks=pytest.mark.slow) for each in AT_LENGTH if can_play(each))],
    ids=" ".join,
)
def test_it_plays_in_every_kind_of_world(overrides: tuple[str, ...]) -> None:
    class Short(Rollout):
        base, horizon, samples = Dispatch, 2, 2

    env = make_env("default", n_worlds=2, overrides=[*overrides, "landscape.size=16"])
    policy, now = Short(env), env.reset()
    mask = env.world.possible_actions(env.world_state)
    base = Dispatch(env).choose(env.world_state, mask)
    action = policy(now)["agents", "action"]
    assert (mask.gather(-1, action[..., None])[..., 0] | (action == base)).all()
    env.step(now)


def believing(
    *at: tuple[int, int], drawing: str = TWO_FIRES, roles: tuple[str, ...] = ("ugv",)
) -> tuple[WildfireEnv, WorldState]:
    """The two fires, in a world whose agents are said to see little."""
    sensing = pytest.importorskip("warp_torchrl.world.mechanics.sensing.sensing")
    env, state = scene(drawing, at=list(at), roles=roles)
    env.world = replace(env.world, steps_per_tick=2, sensing=sensing.Sight())
    return env, state


class Near(Quick):
    """The same for agents within three cells of a fire."""

    near = 3


def test_where_sight_is_limited_agents_plan_that_can_act_near_a_fire() -> None:
    env, state = believing((0, 1))
    assert plan(env, state, Near).tolist() == [[Action.EAST]]
    env, state = believing((0, 1), (3, 7))
    assert Near(env)._near_fire(state).tolist() == [[True, False]], "the fires are 4 columns from (3, 7)"
    env, state = believing((0, 1), (0, 1), roles=("scout", "ugv"))
    assert Near(env)._near_fire(state).tolist() == [[False, True]]


def test_where_sight_is_limited_the_others_do_what_dispatch_does() -> None:
    env, state = believing((1, 2), drawing="TTT~TTT TTT~TTa TTT~TTT TTTTTTT TTTTTTT")
    assert plan(env, state, Near).tolist() == [[Action.SOUTH]], "around the lake"
