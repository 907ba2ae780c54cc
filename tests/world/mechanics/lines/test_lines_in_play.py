"""Lines in play: heuristics that go on with their work, firebreaks as wide as who built them, and what is told."""

import pytest
import torch

from tests.conftest import small_world
from tests.world.mechanics.drawing import begun
from tests.world.mechanics.there import needs
from warp_torchrl import make_env
from warp_torchrl.env import WildfireEnv
from warp_torchrl.heuristics import HEURISTICS
from warp_torchrl.heuristics.base import can_be_put_out
from warp_torchrl.world.air.wind import Calm
from warp_torchrl.world.law.rate import RateFire
from warp_torchrl.world.mechanics.lines.lines import FireLines
from warp_torchrl.world.mechanics.lines.tasks import DONE, Lines
from warp_torchrl.world.state.state import Action
from warp_torchrl.world.team.team import Team

EXTINGUISH, CLEAR = int(Action.EXTINGUISH), int(Action.CLEAR)
RATE = ["fire=rate", "fire.minutes_per_tick=1.0", "steps_per_tick=1", "landscape.size=24", "wind.speed=3.0"]


def meadow(*at, lines, fire=None, wind=(0.0, 0.0), **team):
    """An environment, and a drawn world of its rules, whose fire stands in the middle of a meadow."""
    fire = fire or RateFire(cell_deviation=0.0, minutes_per_tick=1.0)
    rules = {"mechanics": (lines,), "fire": fire, "team": Team(n_agents=len(at), **team), "wind": Calm()}
    world = small_world(**rules, steps_per_tick=1, horizon=500)
    drawing = "TTTTTTTTT " * 4 + "TTTTaTTTT" + " TTTTTTTTT" * 4
    state = begun(world, *at, drawing=drawing, fire=world.fire, wind=wind)
    return WildfireEnv(world, n_worlds=1, seed=0), fire.started(state)


def chosen(env, state, name):
    return HEURISTICS[name](env).choose(state, env.world.possible_actions(state))[0].tolist()


@pytest.mark.parametrize("name", ["local", "greedy", "coordinated", "dispatch"])
def test_who_puts_out_fire_goes_on_until_it_is_out(name):
    env, state = meadow((4, 3), lines=FireLines(water=0.1, means={"ugv": "crew1"}))
    steps = 0
    while state.cells[0, 4, 4] > 10 and steps < 30:
        assert chosen(env, state, name) == [EXTINGUISH]
        state, steps = env.world.step(state, torch.tensor([[EXTINGUISH]])).after, steps + 1
        state = state.replace(
            cells=state.cells.masked_fill((state.cells > 10) & (state.cells != state.cells[0, 4, 4]), 0)
        )
    assert 2 < steps < 30


def test_dispatch_finishes_a_line_that_it_has_begun():
    env, state = meadow((1, 4), lines=FireLines(means={"ugv": "crew2"}), tank=0)
    acts = []
    while not state.firebreak.any() and len(acts) < 20:
        acts.append(chosen(env, state, "dispatch")[0])
        state = env.world.step(state, torch.tensor([acts[-1:]])).after
    first = acts.index(CLEAR)
    assert set(acts[first:]) == {CLEAR} and len(acts[first:]) == 5, "6 m of 30 a minute"


def test_dispatch_goes_on_with_a_line_that_its_plan_has_left():
    env, state = meadow((0, 0), lines=FireLines(means={"ugv": "crew2"}), tank=0)
    assert chosen(env, state, "dispatch") != [CLEAR]
    last = torch.full_like(state.vehicles.last_action, CLEAR)
    assert chosen(env, state.replace(vehicles=state.vehicles.replace(last_action=last)), "dispatch") == [CLEAR]


def test_where_nobody_can_work_at_any_fire_all_count():
    env, state = meadow((4, 3), lines=FireLines(hand_limit=0.0, means={"ugv": "crew1"}))
    assert not env.world.mechanics[0].workable(state, env.world).any()
    assert can_be_put_out(state, env.world).sum() == 1


@pytest.mark.parametrize("name", ["greedy", "coordinated", "dispatch"])
def test_heuristics_go_where_somebody_can_work(name):
    # The fire in the west is nearer, and open to its head and flanks alone; that in the east has a rear.
    lines = FireLines(hand_limit=0.5, means={"ugv": "crew1"})
    fire = RateFire(cell_deviation=0.0, minutes_per_tick=1.0)
    world = small_world(mechanics=(lines,), fire=fire, team=Team(n_agents=1), wind=Calm())
    drawing = "TTTTTTTTTTT ~~TTTTTTTTT ~~aTTTTTTTa ~~TTTTTTTTT"
    state = begun(world, (2, 4), drawing=drawing, fire=fire, wind=(15.0, 0.0))
    assert lines.workable(state, world)[0].nonzero().tolist() == [[2, 10]]
    env = WildfireEnv(world, n_worlds=1, seed=0)
    assert "EAST" in Action(chosen(env, fire.started(state), name)[0]).name


@needs("breach")
def test_a_firebreak_is_as_wide_as_who_built_it():
    from warp_torchrl.world.mechanics.breach.breach import Breach

    breach = Breach(width=20.0)
    world = small_world(mechanics=(breach, FireLines()))
    state = begun(world, (0, 0), (0, 1), drawing="#TT TTT TTT")
    built = state.planes("lines", Lines).work.clone()
    built[0, 0, 0] = 30
    told = state.with_planes("lines", state.planes("lines", Lines).replace(work=built))
    assert breach._widths(told)[0, 0].tolist() == [3.0, 20.0, 20.0]


def test_what_is_told_is_of_the_work():
    seen = ["observation=surroundings", "observation.features=[line]"]
    env = make_env("skirmish", n_worlds=3, overrides=[*RATE, "mechanics.lines.gain=1", *seen])
    names = env.channel_names["status"]
    assert names[-5:] == ("line_done", "line_pace", "fire_done", "fire_pace", "flames")
    now, policy = env.reset(), HEURISTICS["dispatch"](env)
    for _ in range(12):
        now = env.step(policy(now))["next"]
    lines = env.world_state.planes("lines", Lines)
    assert (lines.worked > 0).any() and lines.minutes == 1.0
    assert (now["agents", "observation", "status"][..., -5:] >= 0.0).all()
    assert "line" in env.channel_names["picture"] and lines.work.abs().max() <= DONE
