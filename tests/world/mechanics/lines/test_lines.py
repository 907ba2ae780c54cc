"""Work on lines and fires that takes time, by hand."""

import pytest
import torch

from tests.conftest import small_world
from tests.world.drawing import differing, drawn
from tests.world.mechanics.drawing import begun
from warp_torchrl.world.arrays.random import world_key
from warp_torchrl.world.law.fire import Fire
from warp_torchrl.world.law.rate import RateFire
from warp_torchrl.world.mechanics.lines.lines import FireLines
from warp_torchrl.world.mechanics.lines.tasks import DONE, Lines, progress
from warp_torchrl.world.state.state import Action
from warp_torchrl.world.team.team import Team

EXTINGUISH, CLEAR, STAY = int(Action.EXTINGUISH), int(Action.CLEAR), int(Action.STAY)
MEADOW = "TTTTT TTTTT TTaTT TTTTT TTTTT"
FOREST = " ".join(["fffff"] * 5)
RATE = RateFire(cell_deviation=0.0, minutes_per_tick=1.0)


def scene(lines, *at, fire=None, drawing=MEADOW, ground="", wind=(0.0, 0.0), worlds=1, steps_per_tick=100, **team):
    """Drawn worlds of bulldozers whose fire stays as it is, and their rules."""
    team = Team(**{"n_agents": len(at), **team})
    fire = fire or Fire()
    world = small_world(mechanics=(lines,), fire=fire, team=team, steps_per_tick=steps_per_tick, horizon=10_000)
    return begun(world, *at, drawing=drawing, ground=ground, fire=fire, wind=wind, worlds=worlds), world


def stepped(state, world, *actions):
    return world.step(state, torch.tensor(actions).expand(len(state.cells), -1))


def open_acts(state, world):
    """Of each agent, whether it can extinguish and clear."""
    return world.possible_actions(state)[0, :, EXTINGUISH : CLEAR + 1].tolist()


def test_a_cell_is_cleared_once_its_line_is_as_long_as_its_side():
    # 6 chains an hour are 2.0117 m a minute: 30 m take 14.9 minutes, of half a minute a step 30 steps.
    lines = FireLines(means={"ugv": "crew1"}, minutes_per_tick=50.0)
    state, world = scene(lines, (0, 0), ground=FOREST)
    for step in range(29):
        made = stepped(state, world, CLEAR)
        assert not made.result.credited.any() and not made.result.redundant.any(), step
        state = made.after
    assert drawn(state).startswith("T") and not state.firebreak.any()
    made = stepped(state, world, CLEAR)
    assert made.result.cleared.tolist() == [[True]] and made.after.firebreak[0, 0, 0]
    assert made.after.planes("lines", Lines).work[0, 0, 0] == 9, "a line of 0.9 m"
    assert lines.metrics(made.after)["at_work"].item() == 1.0


def test_agents_at_one_cell_add_up_and_the_first_is_credited():
    lines = FireLines(means={"ugv": "crew1"}, minutes_per_tick=400.0)  # 4 minutes a step: 8.05 m
    state, world = scene(lines, (0, 0), (0, 0), ground=FOREST)
    made = stepped(state, world, CLEAR, CLEAR)
    assert not made.result.redundant.any() and not made.after.vehicles.redundant.any()
    assert made.after.vehicles.last_useful.tolist() == [[0, 0]]
    status = lines.status(made.after)[0, :, 0].tolist()
    assert status == pytest.approx([2 * 8.047 / 30.0] * 2, abs=1e-3)
    made = stepped(made.after, world, CLEAR, CLEAR)
    assert made.result.credited.tolist() == [[True, False]] and made.after.firebreak[0, 0, 0]


def test_work_is_left_where_it_was_done_until_fire_comes():
    lines = FireLines(means={"ugv": "crew1"}, minutes_per_tick=400.0)
    state, world = scene(lines, (0, 0), ground=FOREST)
    for action in (CLEAR, STAY, int(Action.SOUTH), int(Action.NORTH), CLEAR, CLEAR):
        state = stepped(state, world, action).after
    done = state.planes("lines", Lines).work[0, 0, 0].item() / DONE
    assert done == pytest.approx(3 * 8.047 / 30.0, abs=1e-3) and lines.maps["line"](state)[0, 0, 0] == int(done * 256)
    burning = state.cells.clone()
    burning[0, 0, 0] = 11
    assert lines.status(state.replace(cells=burning, age=burning - 1))[0, 0, 2] == 0.0, "nothing is put out of its fire"


def test_work_on_a_line_does_not_count_for_the_fire_that_comes():
    work, target = torch.full((1, 2, 2), 700, dtype=torch.int16), torch.tensor([[3, 3]])
    fire, parts, width = torch.tensor([[True, True]]), torch.tensor([[100, 50]]), torch.zeros(1, 2, dtype=torch.int64)
    assert progress(work, target, fire, parts, width).work[0].tolist() == [[700, 700], [700, -150]]
    assert progress(work, target, ~fire, parts, width).work[0, 1, 1] == 850


def test_to_put_out_takes_the_water_for_its_heat():
    # 30 m x 1,000 kW/m x 30 s / (1 kg/s x 0.3 x 2,600 kJ/kg) are 1,154 s: 19.2 minutes, and 5 a step.
    length = 0.0775 * 1000.0**0.46
    lines = FireLines(flame_length=length, minutes_per_tick=500.0)
    state, world = scene(lines, (1, 1), (1, 2), tank=9)
    for _ in range(3):
        state = stepped(state, world, EXTINGUISH, STAY).after
    assert drawn(state)[14] == "a" and lines.status(state)[0, :, 2].tolist() == pytest.approx([0.78, 0.78], abs=2e-3)
    assert lines.status(state)[0, 0, 3].item() == pytest.approx(0.26, abs=1e-3)
    made = stepped(state, world, STAY, EXTINGUISH)
    assert drawn(made.after)[14] == "T" and made.result.extinguished.tolist() == [[False, True]]
    assert made.after.extinguished[0, 2, 2] and made.after.wet[0, 2, 2] > 0
    assert not made.after.planes("lines", Lines).work.any() and made.after.vehicles.tank.tolist() == [[6, 8]]


@pytest.mark.parametrize(("flames", "hand", "dozer", "aircraft"), [(1.1, 1, 1, 1), (1.3, 0, 1, 1), (2.5, 0, 0, 1)])
def test_nobody_works_at_flames_over_the_limits_of_the_hauling_chart(flames, hand, dozer, aircraft):
    roles = {"roles": ("ugv", "uav"), "tank": 5}
    for means, open_ in (("crew1", hand), ("dozer", dozer)):
        lines = FireLines(flame_length=flames, means={"ugv": means})
        state, world = scene(lines, (1, 1), (2, 2), **roles)
        ground, air = open_acts(state, world)
        assert ground == [open_, open_] and air == [aircraft, False]
        made = stepped(state, world, EXTINGUISH, STAY)
        vehicles = made.after.vehicles
        assert vehicles.tank[0, 0] == 5 - open_ and (vehicles.last_useful[0, 0] == 0) == open_
        assert made.after.planes("lines", Lines).work.any() == open_ and not made.result.credited.any()
    assert not open_acts(*scene(FireLines(aircraft_limit=2.0, flame_length=2.1), (2, 2), roles=("uav",)))[0][0]
    far, world = scene(FireLines(flame_length=9.0), (0, 0))
    assert open_acts(far, world) == [[False, True]], "line is built where no fire is near"


def test_who_could_do_nothing_is_shown_an_act_that_does_nothing():
    state, world = scene(FireLines(flame_length=9.0), (0, 0), drawing="a~ ~~", allow_stay=False, roles=("uav",))
    shut = stepped(state, world, EXTINGUISH)
    assert open_acts(state, world)[0][0] and not differing(
        shut.after.replace(
            vehicles=state.vehicles, step=state.step, extras=state.extras, burning_area=state.burning_area
        ),
        state,
    )


def test_under_law_rate_a_fire_is_open_at_its_rear_and_shut_at_its_head():
    lines, sides = FireLines(means={"ugv": "crew1"}), [(2, 1), (2, 3)]
    state, world = scene(lines, *sides, fire=RATE, wind=(9.0, 0.0))  # in the west, and the east
    assert open_acts(state, world) == [[True, True], [False, False]]
    rear, head = lines.status(state)[0, :, 4].tolist()
    assert 0.0 < rear < 1.0 < head
    assert lines.workable(state, world)[0].nonzero().tolist() == [[2, 2]], "from the rear"
    calm, world = scene(lines, *sides, fire=RATE)
    assert open_acts(calm, world) == [[True, True]] * 2


def test_planners_are_told_what_is_open_and_how_long_lines_take():
    lines = FireLines(means={"ugv": "crew1"}, hand_limit=0.5)
    wall = " ".join(["~~aTT"] * 5)
    state, world = scene(lines, (0, 4), fire=RATE, drawing=wall, ground=" ".join(["~~ggg"] * 5), wind=(15.0, 0.0))
    assert not lines.workable(state, world).any(), "a lake in the rear"
    # 10.06 m a minute, and a hundredth of a minute a step: 298.3 steps for 30 m.
    assert lines.steps_to_clear(state, world)[0, 0, 4].item() == 299.0
    state = stepped(state, world, CLEAR).after
    assert lines.steps_to_clear(state, world)[0, 0, 4].item() == 298.0
    assert lines.workable(*scene(FireLines(), (0, 0))) is None, "flames are alike"


def test_a_world_is_the_same_in_any_batch():
    lines, acts = FireLines(), (EXTINGUISH, CLEAR, EXTINGUISH)
    places = (2, 1), (1, 1), (3, 3)
    fire = RateFire(minutes_per_tick=1.0)
    many, few = (scene(lines, *places, fire=fire, wind=(2.0, 1.0), worlds=n, steps_per_tick=1)[0] for n in (67, 5))
    _, world = scene(lines, *places, fire=fire, steps_per_tick=1)
    many, few = (fire.started(each) for each in (many, few))
    for _ in range(4):
        many, few = (stepped(each, world, *acts).after for each in (many, few))
    assert not differing(many[torch.arange(5)], few)
    assert torch.equal(lines.status(many)[:5], lines.status(few)) and few.planes("lines", Lines).work.any()
    assert torch.equal(few.key, world_key(torch.arange(5), torch.zeros(5, dtype=torch.int64)))


@pytest.mark.parametrize(
    ("wrong", "rule"),
    [
        ({"gain": 0.0}, "gain must be in"),
        ({"dozer_limit": 26.0}, "dozer_limit must be in"),
        ({"means": {"ugv": "shovel"}}, "means.ugv must be crew1 or crew2 or dozer"),
        ({"means": {"ugw": "crew1"}}, "means must name roles of ugv.*got ugw"),
    ],
)
def test_what_cannot_be_is_refused(wrong, rule):
    with pytest.raises(ValueError, match=rule):
        FireLines(**wrong)


def test_what_is_not_read_under_law_rate_is_refused():
    with pytest.raises(ValueError, match=r"lines\.minutes_per_tick is read under other laws than rate alone"):
        small_world(mechanics=(FireLines(minutes_per_tick=2.0),), fire=RATE)


def test_planners_are_told_how_long_an_agent_alone_takes():
    # Flames of 1 m: I = (1 / 0.0775)^(1 / 0.46) kW/m; t = 30 m x I x 30 s / 780 kW, and a step is a twentieth minute.
    strong = (1.0 / 0.0775) ** (1.0 / 0.46)
    lines = FireLines(means={"ugv": "crew1"})
    state, _ = scene(lines, (2, 1), (0, 0), ground=FOREST)
    cells = torch.tensor([[12, 12]])
    takes = lines.steps_to_put_out(state, cells)
    assert takes.flatten().tolist() == pytest.approx([30 * strong * 30 / 780 / 60 / 0.05] * 4, rel=1e-4)
    fire, line = lines.steps_here(state)
    assert fire[0, 0].item() == pytest.approx(takes[0, 0, 0].item(), rel=0.01)
    assert line[0, 1].item() == pytest.approx(30 / 2.01168 / 0.05, rel=0.02), "in whole parts of 16,384"
    shut = FireLines(means={"ugv": "crew1"}, hand_limit=0.9)
    assert torch.isinf(shut.steps_to_put_out(scene(shut, (2, 1))[0], cells)).all()
    flies, _ = scene(FireLines(), (2, 1), roles=("uav",))
    assert FireLines().steps_to_put_out(flies, cells).tolist() == [[[1.0, 1.0]]], "aircraft drop at once"


def test_they_are_told_of_the_side_on_which_a_fire_is_weakest():
    lines = FireLines()
    state, _ = scene(lines, (2, 1), (2, 3), fire=RATE, wind=(9.0, 0.0))  # in the rear, and at the head
    takes = lines.steps_to_put_out(state, torch.tensor([[12]]))[0, :, 0]
    rear, head = lines.steps_here(state)[0][0].tolist()
    assert takes[0] == takes[1] == pytest.approx(rear, rel=0.01) and rear < head
