"""The planner that chooses among tactics, by hand, and what it may not know."""

from dataclasses import replace
from typing import ClassVar

import pytest
import torch
from torch import Tensor

from tests.heuristics.drawing import scene
from tests.world.drawing import differing
from tests.world.mechanics.there import needs
from warp_torchrl import make_env
from warp_torchrl.heuristics import HEURISTICS, Dispatch, Heuristic, NoOp, PointProtection, Switching
from warp_torchrl.heuristics.imagining import Choice
from warp_torchrl.world.fires.imagined import imagined
from warp_torchrl.world.state.state import Action, WorldState
from warp_torchrl.world.world import World

ONE_FIRE = "TTTTT TTaTT TTTTT TTTTT TTTTT"


class Quick(Switching):
    """The planner between nothing and dispatch, with a short look ahead."""

    tactics: ClassVar[tuple[type[Heuristic], ...]] = (NoOp, Dispatch)
    period, horizon, samples = 4, 12, 3


class Backward(Quick):
    """The same, which begins with dispatch."""

    tactics = (Dispatch, NoOp)


def choice(policy, state):
    return policy.choose(state, policy.world.possible_actions(state)).tolist()


def test_it_follows_what_saves_more() -> None:
    env, state = scene(ONE_FIRE, at=[(1, 1)])
    for kind in (Quick, Backward):
        assert choice(kind(env), state) == [[Action.EXTINGUISH]]


def test_it_keeps_its_tactic_until_the_next_choice() -> None:
    env, state = scene(ONE_FIRE, at=[(1, 1)])
    policy, at = Quick(env), lambda step: state.replace(step=torch.full_like(state.step, step))
    still = choice(NoOp(env), state)
    assert choice(policy, at(2)) == still
    assert choice(policy, at(4)) == [[Action.EXTINGUISH]]
    assert choice(policy, at(5)) == [[Action.EXTINGUISH]]
    assert choice(policy, at(0).replace(terminated=torch.ones_like(state.terminated))) == still, "a new episode"


def test_where_tactics_do_alike_it_stays_with_its_own() -> None:
    env, state = scene("TTTTT TTTTT TTTTT TTTTT", at=[(1, 1)])
    assert choice(Quick(env), state) == choice(NoOp(env), state)
    last = torch.ones(1, dtype=torch.int64)
    assert torch.equal(Quick(env)._best(state, last), last)
    env, state = scene("a..TT ...TT TTTTT TTTTT", at=[(2, 4)])
    policy = Quick(env)
    policy.horizon = 1
    assert choice(policy, state) == choice(NoOp(env), state), "a step saves nothing yet"


def test_a_gain_must_be_more_than_a_standard_error(monkeypatch: pytest.MonkeyPatch) -> None:
    env, state = scene(ONE_FIRE, at=[(1, 1)])
    policy, gains = Quick(env), iter(([0.0] * 3, [4.0, 0.0, 0.0], [0.0] * 3, [6.0, 1.0, 1.0]))
    reached = lambda *_: torch.tensor(next(gains), dtype=torch.float64)  # noqa: E731
    monkeypatch.setattr("warp_torchrl.heuristics.switching.played", reached)
    found = [policy._best(state, torch.zeros(1, dtype=torch.int64)).tolist() for _ in range(2)]
    assert found == [[0], [1]], "4/3 less 4/3, and 8/3 less 5/3"


@needs("values")
@pytest.mark.parametrize(("goal", "sign"), [("worth_saved", 1.0), ("fire_size", -1.0), (None, 0.0)])
def test_what_is_reached_is_the_goal_then_the_forest(goal: str | None, sign: float) -> None:
    env = make_env("default", n_worlds=2, overrides=["mechanics.values={}"])
    env.reset()
    env.world = replace(env.world, goal=goal)
    state, counts = env._current()
    values = {name: value for each in env.world.loop for name, value in each.metrics(state).items()}
    saved = counts.saved().double()
    told = sign * values[goal].double() + 0.01 * saved if goal else saved
    assert torch.equal(Quick(env)._reached(state, counts), told)


@needs("values")
def test_an_escape_counts_by_the_size_of_the_fire() -> None:
    env = make_env("default", n_worlds=3, overrides=["mechanics.values={}", "goal=escaped"])
    env.reset()
    state, counts = env._current()
    exposure = state.extras.held["values"].replace(size=torch.tensor([0.25, 1.0, 7.0]))
    told = Quick(env)._reached(state.with_planes("values", exposure), counts) - 0.01 * counts.saved().double()
    assert told.tolist() == pytest.approx([-0.25, -1.0, -1.0], abs=1e-12)


def test_it_chooses_for_a_world_as_it_does_for_it_alone() -> None:
    env = make_env("shift", n_worlds=6, overrides=["landscape.size=16", "team.n_agents=2"])
    env.reset()
    state = env.world_state
    together = choice(Quick(env), state)
    assert together != choice(NoOp(env), state)
    assert [choice(Quick(env), state[at : at + 1])[0] for at in range(6)] == together


def test_it_plans_in_parts_as_it_does_at_once(monkeypatch: pytest.MonkeyPatch) -> None:
    """Dispatch is said to be better in two of six worlds; three futures of each, in parts of five."""
    env = make_env("skirmish", n_worlds=6)
    env.reset()
    policy, state = Quick(env), env.world_state
    policy.cells = 5 * state.cells[0].numel()
    better = state.key[[1, 4]]

    def said(_: World, futures: WorldState, choose: Choice, *__: object) -> Tensor:
        assert len(futures.key) <= 5
        gain = torch.isin(futures.origin, better).double()
        return gain if isinstance(choose.__self__, Dispatch) else torch.zeros_like(gain)

    monkeypatch.setattr("warp_torchrl.heuristics.switching.played", said)
    assert policy._best(state, torch.zeros(6, dtype=torch.int64)).tolist() == [0, 1, 0, 0, 1, 0]


def test_futures_differ_and_none_is_the_true_one(monkeypatch: pytest.MonkeyPatch) -> None:
    env = make_env("skirmish", n_worlds=2)
    env.reset()
    state, keys = env.world_state, []

    def drawn(futures: WorldState, key: Tensor, world: World) -> WorldState:
        keys.append(torch.cat((key, state.key)))
        return imagined(futures, key, world)

    monkeypatch.setattr("warp_torchrl.heuristics.switching.imagined", drawn)
    choice(Quick(env), state)
    assert len(keys[0].unique()) == 2 * 3 + 2


def test_planning_changes_nothing() -> None:
    env = make_env("skirmish", n_worlds=2)
    env.reset()
    before = env.world_state.clone()
    choice(Quick(env), env.world_state)
    assert differing(env.world_state, before) == []


@needs("arrivals")
def test_it_makes_no_plan_while_nobody_is_there(monkeypatch: pytest.MonkeyPatch) -> None:
    env = make_env("default", n_worlds=2, overrides=["mechanics.arrivals.minutes={ugv:30}", "team.allow_stay=true"])
    env.reset()
    monkeypatch.setattr(Quick, "_best", lambda *_: pytest.fail("it planned"))
    choice(Quick(env), env.world_state)


def test_it_is_a_baseline_with_the_tactics_of_the_trade() -> None:
    assert HEURISTICS["switching"] is Switching and Switching.tactics[0] is Dispatch
    assert PointProtection in Switching.tactics
