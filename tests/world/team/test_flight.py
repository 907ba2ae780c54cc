"""Separation, batteries and drift of aircraft, by hand."""

import pytest
import torch

from tests.world.drawing import draw
from warp_torchrl.world.state.state import Action
from warp_torchrl.world.team.flight import Flight, wind_at
from warp_torchrl.world.team.team import Team

STAY, EAST = int(Action.STAY), int(Action.EAST)
MAP = " ".join(["T" * 9] * 9)
CALM = (0.0, 0.0)


def stepped(state, team, *actions, running=True):
    """The worlds after the acts of one step."""
    action = torch.tensor(actions).expand(len(state.cells), -1)
    after, _ = team.act(state, action, torch.full((len(state.cells),), running), 14, 10)
    return after.replace(step=after.step + 1)


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
    team = Team(n_agents=2, roles=("uav", "scout"), flight=Flight(separation=separation))
    state = draw(MAP, team=team, at=[(4, 4), other])
    assert stepped(state, team, STAY, STAY).vehicles.near_misses[0].tolist() == near
    assert stepped(state, team, STAY, STAY, running=False).vehicles.near_misses[0].tolist() == [0, 0]


def test_near_misses_are_counted_after_the_moves_and_add_up():
    team = Team(n_agents=3, roles=("scout", "scout", "ugv"), flight=Flight(separation=2.0))
    state = draw(MAP, team=team, at=[(4, 2), (4, 5), (4, 4)])
    state = stepped(state, team, EAST, STAY, STAY)  # two cells: to (4, 4), on the bulldozer and beside a scout
    assert state.vehicles.near_misses[0].tolist() == [1, 1, 0]
    assert stepped(state, team, STAY, STAY, STAY).vehicles.near_misses[0].tolist() == [2, 2, 0]


def test_a_team_without_the_options_counts_nothing():
    team = Team(n_agents=2, roles=("scout",))
    vehicles = stepped(draw(MAP, team=team, at=[(4, 4), (4, 4)], wind=(9.0, 0.0)), team, STAY, STAY).vehicles
    assert vehicles.near_misses is None and vehicles.battery is None
    assert vehicles.position[0].tolist() == [[4, 4], [4, 4]]


def test_flying_takes_charge_and_an_empty_battery_keeps_an_aircraft_where_it_is():
    team = Team(n_agents=2, roles=("scout", "ugv"), flight=Flight(battery=2))
    state = draw(MAP, team=team, at=[(4, 2), (4, 2)])
    state = state.replace(vehicles=state.vehicles.replace(base=torch.tensor([[0, 0]])))
    state = stepped(state, team, EAST, EAST)
    assert state.vehicles.battery[0].tolist() == [1, 2] and team.action_mask(state, 14)[0, 0, EAST]
    state = stepped(state, team, STAY, STAY)
    assert state.vehicles.battery[0].tolist() == [0, 2], "hovering takes charge too"
    assert not team.action_mask(state, 14)[0, 0, :8].any() and team.action_mask(state, 14)[0, 1, :8].all()
    assert team.action_mask(state, 14)[0, 0, STAY]
    state = stepped(state, team, EAST, EAST)
    assert state.vehicles.position[0].tolist() == [[4, 4], [4, 4]]
    assert state.vehicles.battery[0].tolist() == [0, 2]


@pytest.mark.parametrize(("at", "left"), [((0, 0), 5), ((1, 1), 5), ((0, 2), 2)])
def test_batteries_are_charged_within_a_cell_of_the_base(at, left):
    team = Team(n_agents=1, roles=("scout",), flight=Flight(battery=5))
    state = draw(MAP, team=team, at=[at])
    vehicles = state.vehicles.replace(base=torch.tensor([[0, 0]]), battery=torch.tensor([[3]], dtype=torch.int32))
    state = state.replace(vehicles=vehicles)
    assert stepped(state, team, STAY).vehicles.battery.tolist() == [[left]]
    assert stepped(state, team, STAY, running=False).vehicles.battery.tolist() == [[3]]


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
    team = Team(n_agents=2, roles=("scout", "ugv"), flight=Flight(drift=1.0))
    state = draw(MAP, team=team, at=[(4, 4), (4, 4)], wind=wind)
    assert stepped(state, team, STAY, STAY).vehicles.position[0].tolist() == [to, [4, 4]]
    assert stepped(state, team, STAY, STAY, running=False).vehicles.position[0].tolist() == [[4, 4], [4, 4]]


def test_the_wind_carries_nobody_over_the_edge_nor_off_the_ground():
    team = Team(n_agents=2, roles=("scout",), flight=Flight(drift=1.0, battery=9))
    state = draw(MAP, team=team, at=[(4, 8), (4, 4)], wind=(5.0, 0.0))
    state = state.replace(vehicles=state.vehicles.replace(battery=torch.tensor([[9, 0]], dtype=torch.int32)))
    assert stepped(state, team, STAY, STAY).vehicles.position[0].tolist() == [[4, 8], [4, 4]]


def test_drift_comes_with_its_chance_after_the_move():
    team = Team(n_agents=2, roles=("scout",), flight=Flight(drift=0.1))
    state = draw(MAP, team=team, at=[(4, 2), (4, 2)], wind=(3.0, 4.0), worlds=2000)
    after = stepped(state, team, EAST, EAST).vehicles.position
    drifted = (after == torch.tensor([3, 5])).all(-1)
    assert (drifted | (after == torch.tensor([4, 4])).all(-1)).all()
    assert abs(drifted.float().mean().item() - 0.5) < 0.035  # 4000 draws: 4.4 standard deviations
    assert (drifted[:, 0] != drifted[:, 1]).any()
    alone = stepped(state[7:8], team, EAST, EAST).vehicles.position
    assert torch.equal(alone, after[7:8])


def test_each_aircraft_feels_the_wind_of_its_own_cell():
    field = torch.zeros(2, 9, 9)
    field[0, 4, 4], field[1, 2, 2] = 7.0, 3.0
    team = Team(n_agents=2, roles=("scout",), flight=Flight(drift=1.0))
    state = draw(MAP, team=team, at=[(4, 4), (2, 2)], wind=field)
    assert wind_at(state)[0].tolist() == [[7.0, 0.0], [0.0, 3.0]]
    assert stepped(state, team, STAY, STAY).vehicles.position[0].tolist() == [[4, 5], [1, 2]]


@pytest.mark.parametrize(
    ("wrong", "rule"),
    [
        ({"separation": -1.0}, "separation must be in"),
        ({"battery": 0}, "battery must be in"),
        ({"drift": 1.5}, "drift must be in"),
    ],
)
def test_what_cannot_be_is_refused(wrong, rule):
    with pytest.raises(ValueError, match=rule):
        Flight(**wrong)
