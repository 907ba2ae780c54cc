"""Separation, batteries and drift of aircraft, by hand."""

import pytest
import torch

from tests.world.drawing import draw
from warp_torchrl.world.mechanics.flight.flight import Aircraft, Flight
from warp_torchrl.world.state.state import Action
from warp_torchrl.world.team.places import wind_at
from warp_torchrl.world.team.team import Team
from warp_torchrl.world.world import World

STAY, EAST = int(Action.STAY), int(Action.EAST)
MAP = " ".join(["T" * 9] * 9)
CALM = (0.0, 0.0)


def begun(roles, flight, **drawing):
    """Worlds of a team that flies by some rules, and the rules."""
    world = World(team=Team(n_agents=len(drawing["at"]), roles=roles), mechanics=(flight,))
    return flight.begin(draw(MAP, team=world.team, **drawing), world), world


def stepped(state, world, *actions, running=True):
    """The worlds after the acts of one step."""
    action = torch.tensor(actions).expand(len(state.cells), -1)
    after, _ = world.team.act(state, action, torch.full((len(state.cells),), running), 14, 10, world.mechanics)
    return after.replace(step=after.step + 1)


def counted(state):
    """What is counted of the aircraft."""
    return state.planes("flight", Aircraft)


def with_batteries(state, left):
    """Worlds whose base is in the north-west, with batteries [B, A]."""
    vehicles = state.vehicles.replace(base=torch.tensor([[0, 0]]))
    batteries = counted(state).replace(battery=torch.tensor(left, dtype=torch.int32))
    return state.replace(vehicles=vehicles).with_planes("flight", batteries)


@pytest.mark.parametrize(
    ("separation", "other", "near"),
    [
        (1.5, (4, 5), [1, 1]),
        (1.5, (5, 5), [1, 1]),  # sqrt(2) away
        (1.4, (5, 5), [0, 0]),
        (2.0, (4, 6), [0, 0]),  # as near as they may be
        (2.0, (4, 4), [1, 1]),
        (0.0, (4, 4), [0, 0]),
    ],
)
def test_aircraft_that_end_a_step_too_near_have_a_near_miss_each(separation, other, near):
    state, world = begun(("uav", "scout"), Flight(separation=separation), at=[(4, 4), other])
    assert counted(stepped(state, world, STAY, STAY)).near_misses[0].tolist() == near
    assert counted(stepped(state, world, STAY, STAY, running=False)).near_misses[0].tolist() == [0, 0]


def test_near_misses_are_counted_after_the_moves_and_add_up():
    state, world = begun(("scout", "scout", "ugv"), Flight(separation=2.0), at=[(4, 2), (4, 5), (4, 4)])
    state = stepped(state, world, EAST, STAY, STAY)  # two cells: to (4, 4), on the bulldozer and beside a scout
    assert counted(state).near_misses[0].tolist() == [1, 1, 0]
    assert counted(stepped(state, world, STAY, STAY, STAY)).near_misses[0].tolist() == [2, 2, 0]


def test_rules_without_options_count_nothing():
    state, world = begun(("scout",), Flight(), at=[(4, 4), (4, 4)], wind=(9.0, 0.0))
    after = stepped(state, world, STAY, STAY)
    assert not counted(after).leaves() and not world.mechanics[0].metrics(after)
    assert after.vehicles.position[0].tolist() == [[4, 4], [4, 4]]


def test_flying_takes_charge_and_an_empty_battery_keeps_an_aircraft_where_it_is():
    state, world = begun(("scout", "ugv"), Flight(battery=2), at=[(4, 2), (4, 2)])
    state = with_batteries(state, [[2, 2]])
    state = stepped(state, world, EAST, EAST)
    assert counted(state).battery[0].tolist() == [1, 2] and world.action_mask(state)[0, 0, EAST]
    state = stepped(state, world, STAY, STAY)
    assert counted(state).battery[0].tolist() == [0, 2], "hovering takes charge too"
    assert not world.action_mask(state)[0, 0, :8].any() and world.action_mask(state)[0, 1, :8].all()
    assert world.action_mask(state)[0, 0, STAY]
    state = stepped(state, world, EAST, EAST)
    assert state.vehicles.position[0].tolist() == [[4, 4], [4, 4]]
    assert counted(state).battery[0].tolist() == [0, 2]


@pytest.mark.parametrize(("at", "left"), [((0, 0), 5), ((1, 1), 5), ((0, 2), 2)])
def test_batteries_are_charged_within_a_cell_of_the_base(at, left):
    state, world = begun(("scout",), Flight(battery=5), at=[at])
    state = with_batteries(state, [[3]])
    assert counted(stepped(state, world, STAY)).battery.tolist() == [[left]]
    assert counted(stepped(state, world, STAY, running=False)).battery.tolist() == [[3]]


@pytest.mark.parametrize(
    ("wind", "to"),
    [
        ((5.0, 0.0), [4, 5]),
        ((-5.0, 0.0), [4, 3]),
        ((0.0, 5.0), [3, 4]),
        ((4.0, 4.0), [3, 5]),
        ((5.0, -1.0), [4, 5]),  # 11 degrees from east
        ((-4.0, -3.0), [5, 3]),
        (CALM, [4, 4]),
    ],
)
def test_the_wind_carries_aircraft_to_the_neighbour_downwind(wind, to):
    state, world = begun(("scout", "ugv"), Flight(drift=1.0), at=[(4, 4), (4, 4)], wind=wind)
    assert stepped(state, world, STAY, STAY).vehicles.position[0].tolist() == [to, [4, 4]]
    assert stepped(state, world, STAY, STAY, running=False).vehicles.position[0].tolist() == [[4, 4], [4, 4]]


def test_the_wind_carries_nobody_over_the_edge_nor_off_the_ground():
    state, world = begun(("scout",), Flight(drift=1.0, battery=9), at=[(4, 8), (4, 4)], wind=(5.0, 0.0))
    state = with_batteries(state, [[9, 0]])
    assert stepped(state, world, STAY, STAY).vehicles.position[0].tolist() == [[4, 8], [4, 4]]


def test_drift_comes_with_its_chance_after_the_move():
    state, world = begun(("scout",), Flight(drift=0.1), at=[(4, 2), (4, 2)], wind=(3.0, 4.0), worlds=2000)
    after = stepped(state, world, EAST, EAST).vehicles.position
    drifted = (after == torch.tensor([3, 5])).all(-1)
    assert (drifted | (after == torch.tensor([4, 4])).all(-1)).all()
    assert abs(drifted.float().mean().item() - 0.5) < 0.035  # 4000 draws: 4.4 standard deviations
    assert (drifted[:, 0] != drifted[:, 1]).any()
    alone = stepped(state[7:8], world, EAST, EAST).vehicles.position
    assert torch.equal(alone, after[7:8])


def test_each_aircraft_feels_the_wind_of_its_own_cell():
    field = torch.zeros(2, 9, 9)
    field[0, 4, 4], field[1, 2, 2] = 7.0, 3.0
    state, world = begun(("scout",), Flight(drift=1.0), at=[(4, 4), (2, 2)], wind=field)
    assert wind_at(state)[0].tolist() == [[7.0, 0.0], [0.0, 3.0]]
    assert stepped(state, world, STAY, STAY).vehicles.position[0].tolist() == [[4, 5], [1, 2]]


@pytest.mark.parametrize(
    ("wrong", "rule"),
    [
        ({"separation": -1.0}, "separation must be in"),
        ({"separation": 1.1e6}, "separation must be in"),
        ({"battery": 0}, "battery must be in"),
        ({"battery": 1_000_001}, "battery must be in"),
        ({"drift": float("nan")}, "drift must be in"),
        ({"drift": 1.5}, "drift must be in"),
    ],
)
def test_what_cannot_be_is_refused(wrong, rule):
    with pytest.raises(ValueError, match=rule):
        Flight(**wrong)
