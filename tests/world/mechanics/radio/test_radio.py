"""Who hears whom."""

import pytest
import torch

from tests.conftest import small_world
from tests.world.drawing import draw, tiled
from warp_torchrl.world.mechanics.radio.radio import Radio
from warp_torchrl.world.team.hearing import Hearing
from warp_torchrl.world.team.team import Team

PLACES = [(0, 0), (3, 4), (0, 11), (3, 5)]
MAP = tiled("...... ......", 2, 2)


FOUR = Team(n_agents=4)


def heard(state, radio, team=FOUR):
    return radio.arriving(state, team.table(state.cells.device).flies)


def links(state, radio, team=FOUR):
    return {(i, j) for i, j in heard(state, radio, team)[0].nonzero().tolist()}


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
    assert links(draw(MAP, team=FOUR, at=PLACES), Radio(range=reach)) == expected


def test_without_limits_all_hear_all():
    state = draw(MAP, team=FOUR, at=PLACES, worlds=2)
    assert torch.equal(heard(state, Hearing()), heard(state, Radio()))
    assert small_world().hearing == Hearing() and small_world(mechanics=(Radio(loss=0.5),)).hearing == Radio(loss=0.5)


def test_without_a_radio_not_even_those_in_the_same_cell_are_heard():
    team = Team(n_agents=2)
    assert links(draw(MAP, team=team, at=[(1, 1), (1, 1)]), Radio(range=0.0), team) == set()


def test_packets_are_lost_one_by_one_with_their_chance():
    state, radio = draw(MAP, team=FOUR, at=PLACES, worlds=200), Radio(loss=0.3)
    now, later = (heard(each, radio) for each in (state, state.replace(step=state.step + 1)))
    pairs = ~torch.eye(4, dtype=torch.bool)
    share = torch.stack((now, later))[:, :, pairs].float().mean().item()
    assert abs(share - 0.7) < 0.03  # 4800 draws: 4.5 standard deviations, an error in 100 000
    assert (now != later).any() and (now != now.transpose(1, 2)).any()
    assert not links(state, Radio(loss=1.0))
    assert torch.equal(heard(state[7:9], radio), now[7:9])


def test_a_ridge_between_two_bulldozers_keeps_them_from_hearing_each_other_and_not_an_aircraft_above():
    heights = [[0.0, 0.0, 40.0, 0.0, 0.0]] * 2
    at = [(0, 0), (0, 4), (1, 4)]
    team = Team(n_agents=3, roles=("ugv", "ugv", "uav"))
    state = draw("..... .....", team=team, at=at, elevation=heights)
    # The line from the first antenna, 3 m up, to the aircraft, 100 m up, enters the ridge's cell at 42 m.
    radio = Radio(line_of_sight=True)
    assert links(state, radio, team) == {(0, 2), (2, 0), (1, 2), (2, 1)}
    assert (0, 1) in links(state, Radio(), team)
    flat = draw("..... .....", team=team, at=at)
    assert (0, 1) in links(flat, radio, team)


def test_agents_know_where_those_are_whom_they_hear():
    shown = Radio(range=5.0).observed(draw(MAP, team=FOUR, at=PLACES), torch.zeros(4, dtype=torch.bool))[0]
    assert shown[0, 1].tolist() == [1.0, 3.0, 4.0]
    assert shown[1, 0].tolist() == [1.0, -3.0, -4.0]
    assert shown[0, 2].tolist() == [0.0, 0.0, 0.0], "too far to be heard"


def test_it_carries_no_maps_to_agents_that_see_all():
    rule = "mechanics.radio.carries must be none or graph where agents see all"
    with pytest.raises(ValueError, match=rule):
        small_world(mechanics=(Radio(carries="map"),))


@pytest.mark.parametrize(
    ("field", "values"),
    [
        ("range", [-0.1, 1.1e6, float("nan")]),
        ("loss", [-0.1, 1.1, float("nan")]),
        ("delay", [-1, 65, 0.5]),
        ("carries", ["graphs"]),
    ],
)
def test_a_bad_value_is_an_error_that_names_the_field(field, values):
    for value in values:
        with pytest.raises(ValueError, match=field):
            Radio(**{field: value})
