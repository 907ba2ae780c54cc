"""Who hears whom."""

import pytest
import torch

from tests.world.drawing import draw, tiled
from warp_torchrl.world.team.radio import Radio
from warp_torchrl.world.team.team import Team

PLACES = [(0, 0), (3, 4), (0, 11), (3, 5)]
MAP = tiled("...... ......", 2, 2)


def heard(state, team):
    return team.radio.heard(state, team.table(state.cells.device).flies)


def links(state, team, world=0):
    return {(i, j) for i, j in heard(state, team)[world].nonzero().tolist()}


@pytest.mark.parametrize(
    ("reach", "expected"),
    [
        (0.0, set()),
        (1.0, {(1, 3), (3, 1)}),
        (5.0, {(0, 1), (1, 0), (1, 3), (3, 1)}),  # 3, 4, 5: a triangle
        (None, {(i, j) for i in range(4) for j in range(4) if i != j}),
    ],
)
def test_agents_hear_those_within_range_and_not_themselves(reach, expected):
    team = Team(n_agents=4, radio=Radio(range=reach))
    assert links(draw(MAP, team=team, at=PLACES), team) == expected


def test_without_a_radio_not_even_those_in_the_same_cell_are_heard():
    team = Team(n_agents=2, radio=Radio(range=0.0))
    assert links(draw(MAP, team=team, at=[(1, 1), (1, 1)]), team) == set()


def test_packets_are_lost_one_by_one_with_their_chance():
    team = Team(n_agents=4, radio=Radio(loss=0.3))
    state = draw(MAP, team=team, at=PLACES, worlds=200)
    now, later = (heard(each, team) for each in (state, state.replace(step=state.step + 1)))
    pairs = ~torch.eye(4, dtype=torch.bool)
    share = torch.stack((now, later))[:, :, pairs].float().mean().item()
    assert abs(share - 0.7) < 0.03  # 4800 draws: 4.5 standard deviations, an error in 100 000
    assert (now != later).any() and (now != now.transpose(1, 2)).any()
    assert not links(state, Team(n_agents=4, radio=Radio(loss=1.0)))
    assert torch.equal(heard(state[7:9], team), now[7:9])


def test_a_ridge_between_two_bulldozers_keeps_them_from_hearing_each_other_and_not_an_aircraft_above():
    heights = [[0.0, 0.0, 40.0, 0.0, 0.0]] * 2
    at = [(0, 0), (0, 4), (1, 4)]
    team = Team(n_agents=3, roles=("ugv", "ugv", "uav"), radio=Radio(line_of_sight=True))
    state = draw("..... .....", team=team, at=at, elevation=heights)
    # The line from the first antenna, 3 m up, to the aircraft, 100 m up, enters the ridge's cell at 42 m.
    assert links(state, team) == {(0, 2), (2, 0), (1, 2), (2, 1)}
    blind = Team(n_agents=3, roles=("ugv", "ugv", "uav"))
    assert (0, 1) in links(state, blind)
    flat = draw("..... .....", team=team, at=at)
    assert (0, 1) in links(flat, team)


def test_agents_know_where_those_are_whom_they_hear():
    team = Team(n_agents=4, radio=Radio(range=5.0))
    shown = team.radio.observed(draw(MAP, team=team, at=PLACES), torch.zeros(4, dtype=torch.bool))[0]
    assert shown[0, 1].tolist() == [1.0, 3.0, 4.0]
    assert shown[1, 0].tolist() == [1.0, -3.0, -4.0]
    assert shown[0, 2].tolist() == [0.0, 0.0, 0.0], "too far to be heard"
