"""Drops by hand: what they cover and hold, when they fall, and how they are loaded."""

import pytest
import torch

from tests.conftest import small_world
from tests.heuristics.drawing import chosen
from tests.world.drawing import differing, drawn
from tests.world.mechanics.drawing import begun
from warp_torchrl.env import WildfireEnv
from warp_torchrl.world.behaviour.firebreaks import intensity_of
from warp_torchrl.world.law.fire import Fire
from warp_torchrl.world.law.rate import RateFire
from warp_torchrl.world.mechanics.drops.drops import Drops
from warp_torchrl.world.mechanics.drops.loads import Loads, held_intensity
from warp_torchrl.world.mechanics.drops.smoke import smoke_at
from warp_torchrl.world.state.state import Action
from warp_torchrl.world.team.team import Team

DROP, STAY, EAST, SOUTH = int(Action.EXTINGUISH), int(Action.STAY), int(Action.EAST), int(Action.SOUTH)
ROW = "TTTTTTT TaaaaaT TTTTTTT TTTTTTT"
RATE = RateFire(cell_deviation=0.0, minutes_per_tick=1.0)


def scene(drops, *at, drawing=ROW, base=(3, 6), fire=None, wind=(0.0, 0.0), worlds=1, tank=2, steps_per_tick=1, **team):
    """Drawn worlds of aircraft that drop, and their rules."""
    fire = fire or Fire(youngest_fuel=1)
    team = Team(**{"n_agents": len(at), "roles": ("uav",), "tank": tank, **team})
    world = small_world(mechanics=(drops,), fire=fire, team=team, steps_per_tick=steps_per_tick, horizon=10_000)
    state = begun(world, *at, drawing=drawing, fire=fire, wind=wind, worlds=worlds)
    vehicles = state.vehicles.replace(base=torch.tensor([base]).expand(worlds, -1))
    return fire.started(state.replace(vehicles=vehicles)), world


def headed(state, *directions):
    loads = state.planes("drops", Loads)
    return state.with_planes("drops", loads.replace(heading=torch.tensor([directions]).expand_as(loads.heading)))


def stepped(state, world, *actions):
    return world.step(state, torch.tensor(actions).expand(len(state.cells), -1))


def act(state, world, *actions):
    """The worlds after the acts alone."""
    action, running = torch.tensor(actions).expand(len(state.cells), -1), ~state.done
    return world.team.act(state, action, running, world.fire.last_spreading, world.fire.wet_for, world.loop)


def coverage(state):
    return state.planes("drops", Loads).coverage[0]


def test_a_drop_covers_a_line_along_the_heading():
    # 3,000 l at level 4, 1.63 l to a square metre, 20 m wide: 92 m, three cells of 30 m.
    state, world = scene(Drops(), (1, 1))
    after, result = act(headed(state, EAST), world, DROP)
    assert drawn(after) == "TTTTTTT TTTTaaT TTTTTTT TTTTTTT"
    assert (coverage(after) == 4.0).nonzero().tolist() == [[1, 1], [1, 2], [1, 3]]
    assert after.extinguished[0, 1, 1:4].all() and (after.wet[0, 1, 1:4] == 1).all() and not after.age[0, 1, 1:4].any()
    assert result.credited.tolist() == [[True]] and after.vehicles.tank.tolist() == [[1]]
    south, _ = act(headed(state, SOUTH), world, DROP)
    assert drawn(south) == "TTTTTTT TTaaaaT TTTTTTT TTTTTTT" and coverage(south)[1:4, 1].tolist() == [4.0] * 3
    wide, _ = act(*scene(Drops(litres=900.0), (1, 1)), DROP)
    assert (coverage(wide) > 0.0).sum() == 1, "one cell at least"


def test_the_heading_is_that_of_the_last_move():
    state, world = scene(Drops(), (2, 1))
    state = stepped(state, world, EAST).after
    assert state.planes("drops", Loads).heading.tolist() == [[EAST]]
    assert stepped(state, world, STAY).after.planes("drops", Loads).heading.tolist() == [[EAST]]


def test_the_level_that_a_fuel_needs_decides_what_is_held():
    load = Drops()._load
    level, fuel = torch.tensor([4.0, 4.0, 2.0, 1.0, 3.0]), torch.tensor([10, 4, 10, 1, 3], dtype=torch.uint8)
    most, usual = intensity_of(3.4), intensity_of(2.4)
    # Litter needs 4, chaparral more than 6, grass 1, tall grass 3.
    assert held_intensity(level, fuel, load).tolist() == pytest.approx(
        [usual, usual / 2, usual / 2, usual, usual], rel=1e-5
    )
    assert held_intensity(torch.tensor([4.0]), torch.tensor([1], dtype=torch.uint8), load).item() == pytest.approx(most)


@pytest.mark.parametrize(("flames", "out"), [(3.3, True), (3.5, False)])
def test_flames_that_are_too_long_are_not_put_out(flames, out):
    state, world = scene(Drops(flame_length=flames), (1, 1))
    after, result = act(headed(state, EAST), world, DROP)
    assert (drawn(after) == "TTTTTTT TTTTaaT TTTTTTT TTTTTTT") == out and result.credited.tolist() == [[out]]
    assert after.vehicles.tank.tolist() == [[1]] and Drops().metrics(after)["on_target"].item() == out


@pytest.mark.parametrize(("agent", "ticks"), [("water", 7), ("retardant", 56)])
def test_water_holds_for_minutes_and_retardant_for_hours(agent, ticks):
    # Flames of 1 m are 260 kW/m, of 2.4 m 1,743: grass, which needs 1, holds them at level 0.15. From 4 it falls to it
    # in 4.74 half-lives: 71 minutes of water, 569 of retardant.
    drops = Drops(agent=agent, minutes_per_tick=10.0, flame_length=1.0)
    state, world = scene(drops, (0, 0), drawing="####### #aT#### #######")
    loads = state.planes("drops", Loads)
    covered = torch.zeros_like(loads.coverage)
    covered[0, 1, 2] = 4.0
    state = state.with_planes("drops", loads.replace(coverage=covered)).replace(wet=(covered > 0.0).to(torch.uint8))
    burning, held = state.cells, 0
    while state.wet[0, 1, 2] > 0 and held < 99:
        state = stepped(state.replace(cells=burning), world, STAY).after  # it burns on
        held += 1
    assert held - 1 == ticks
    assert drawn(stepped(state.replace(cells=burning), world, STAY).after)[9:11] == "ba"


def test_nobody_drops_at_night_or_in_smoke():
    drops = Drops(minutes_per_tick=60.0, begins=17.0)
    state, world = scene(drops, (1, 1))
    assert world.possible_actions(state)[0, 0, DROP]
    dark = state.replace(tick=state.tick + 3)
    assert not world.possible_actions(dark)[0, 0, DROP] and drops.status(dark)[0, 0, 2] == 0.0
    after, result = act(dark, world, DROP)
    assert drawn(after) == drawn(dark) and after.vehicles.tank.tolist() == [[2]] and not result.credited.any()
    smoky, world = scene(Drops(smoke=1.5), (1, 5), (1, 1), wind=(5.0, 0.0))
    assert world.possible_actions(smoky)[0, :, DROP].tolist() == [False, True]
    # 1 + 1/2 + 1/3 + 1/4 + 1/5 in the east, one's own fire in the west.
    assert smoke_at(smoky, 6)[0].tolist() == pytest.approx([2.2833, 1.0], abs=1e-3)
    assert smoke_at(smoky, 2)[0].tolist() == pytest.approx([1.8333, 1.0], abs=1e-3)


@pytest.mark.parametrize(
    ("agent", "at", "loads"), [("water", (2, 1), 1), ("retardant", (2, 1), 0), ("retardant", (1, 1), 1)]
)
def test_water_is_loaded_at_lakes_and_retardant_at_the_base(agent, at, loads):
    drops = Drops(agent=agent, turnaround=15.0, minutes_per_tick=5.0)
    state, world = scene(drops, at, drawing="TTTTT#a TaTTT## TTTTTTT ~TTTTTT", base=(1, 1))
    made = stepped(headed(state, EAST), world, DROP)
    assert made.result.credited.all() and made.after.vehicles.tank.item() == 1 + loads
    waits = made.after.planes("drops", Loads).waits.item()
    assert waits == 3 * loads, "15 minutes, of 5 a step"
    for left in range(waits, 0, -1):
        assert not world.possible_actions(made.after)[0, 0, :9].any() and world.possible_actions(made.after)[0, 0, STAY]
        assert drops.status(made.after)[0, 0, 0].item() == pytest.approx(1.0 - left / 3.0)
        made = stepped(made.after, world, EAST)
        assert not made.result.moved.any()
    assert world.possible_actions(made.after)[0, 0, EAST]


@pytest.mark.parametrize("name", ["greedy", "coordinated", "dispatch"])
@pytest.mark.parametrize(("agent", "way"), [("water", "WEST"), ("retardant", "EAST")])
def test_heuristics_load_where_it_can_be_done(name, agent, way):
    drawing = "TTTTTTTTTTT ~TTTTTTTTTT TTTTTaTTTTT TTTTTTTTTTT"
    state, world = scene(Drops(agent=agent), (1, 4), drawing=drawing, base=(1, 10))
    empty = state.replace(vehicles=state.vehicles.replace(tank=torch.zeros_like(state.vehicles.tank)))
    assert way in chosen(WildfireEnv(world, n_worlds=1, seed=0), empty, name)[0]


def test_bulldozers_beside_aircraft_extinguish_as_ever():
    state, world = scene(Drops(), (0, 1), (1, 5), roles=("ugv", "uav"))
    after, result = act(headed(state, EAST, EAST), world, DROP, DROP)
    assert drawn(after) == "TTTTTTT TTaaaTT TTTTTTT TTTTTTT" and result.credited.tolist() == [[True, True]]
    assert coverage(after).nonzero().tolist() == [[1, 5], [1, 6]]


def test_a_world_is_the_same_in_any_batch():
    drops = Drops(agent="retardant")
    places, fire = ((1, 1), (2, 4)), RateFire(minutes_per_tick=1.0)
    many, few = (scene(drops, *places, fire=fire, wind=(3.0, 1.0), worlds=n)[0] for n in (67, 5))
    _, world = scene(drops, *places, fire=fire)
    for action in (DROP, EAST, DROP, STAY, STAY):
        many, few = (stepped(each, world, action, DROP).after for each in (many, few))
    assert not differing(many[torch.arange(5)], few) and coverage(few).any()
    assert drops.picture(few, 2)[0, :, 0].amax() > 0.0 and drops.maps["coverage"](few).max() == 39, (
        "a little has decayed"
    )


@pytest.mark.parametrize(
    ("world", "rule"),
    [
        ({"team": Team(n_agents=1)}, "drops needs an aircraft that extinguishes in team.roles, got"),
        ({"team": Team(n_agents=1, roles=("uav",))}, "team.tank must be 1 or more where aircraft drop loads, got None"),
        (
            {"team": Team(n_agents=1, roles=("uav",), tank=1), "fire": RATE},
            "drops.flame_length is read under other laws",
        ),
    ],
)
def test_what_does_not_fit_a_world_is_refused(world, rule):
    with pytest.raises(ValueError, match=rule):
        small_world(mechanics=(Drops(flame_length=2.0),), **world)


def test_values_out_of_range_are_refused():
    with pytest.raises(ValueError, match="daylight must be a pair from low to high"):
        Drops(daylight=(20.0, 6.0))
    with pytest.raises(ValueError, match="agent must be water or retardant"):
        Drops(agent="foam")
