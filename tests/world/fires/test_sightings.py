"""Likelihood of what was seen, by sectors about what had burned."""

import math

import pytest
import torch

from warp_torchrl.world.fires.sightings import (
    LOCAL_DEVIATION,
    Front,
    HotSpotSensor,
    beside,
    hot_spot_likelihood,
    perimeter_likelihood,
)

SIDE = 41
ROWS, COLUMNS = torch.meshgrid(torch.arange(SIDE) - 20.0, torch.arange(SIDE) - 20.0, indexing="ij")
FAR = torch.hypot(ROWS, COLUMNS)


def front(known=2.0, burned=8.0):
    return Front(known >= FAR, burned >= FAR, torch.ones(SIDE, SIDE, dtype=torch.bool), 60.0)


def members(*rates):
    """Fires that grow from a circle of 2 cells by a cell in ten minutes."""
    return torch.stack([(FAR - 2.0).clamp(min=0.0) * 10.0 / rate for rate in rates])


def test_the_member_that_grew_as_much_is_likeliest_and_one_more_wrong_is_less_likely():
    found = perimeter_likelihood(members(0.5, 0.8, 1.0, 1.25, 2.0), front())
    assert found.argmax() == 2
    assert bool((found[[1, 3]] > found[[0, 4]]).all()) and float(found[2]) == pytest.approx(0.0, abs=0.1)


def test_a_sector_s_share_is_that_of_a_normal_logarithm():
    # One old cell, two along the front in the east: one growing cell there, of 4 that the member says.
    known, burned = (torch.zeros(3, 9, dtype=torch.bool) for _ in range(2))
    known[1, 0] = burned[1, 0] = burned[1, 1] = True
    fuel = torch.zeros(3, 9, dtype=torch.bool)
    fuel[1] = True
    arrival = torch.full((1, 3, 9), 99.0)
    arrival[0, 1, :5] = 1.0
    found = perimeter_likelihood(arrival, Front(known, burned, fuel, 60.0))
    # f = 1, a = 1/2, q^2 = 1/2: ln (4.5 / 1.5)^2 / 2 / (s^2 + 0.5 / 1.5^2)
    off = math.log(3.0) ** 2 / 2.0 / (LOCAL_DEVIATION**2 + 0.5 / 2.25)
    assert float(found) == pytest.approx(math.log(0.02 + 0.98 * math.exp(-off)), rel=1e-5)


def test_a_member_that_turns_away_is_less_likely_than_one_that_goes_where_the_fire_went():
    east = (COLUMNS >= 0.0) & (ROWS.abs() <= 2.0) & (COLUMNS <= 12.0)
    seen = Front(FAR <= 2.0, (FAR <= 2.0) | east, torch.ones(SIDE, SIDE, dtype=torch.bool), 60.0)
    along, across = torch.where(seen.burned, 1.0, 99.0), torch.where(seen.burned.T, 1.0, 99.0)
    found = perimeter_likelihood(torch.stack((along, across)), seen)
    assert float(found[0]) == 0.0 and float(found[1]) < -4.0


def test_what_cannot_burn_says_nothing():
    seen = front()
    rock = Front(seen.known, seen.burned, seen.fuel & (COLUMNS < 6.0), 60.0)
    wide = torch.where(COLUMNS >= 6.0, 1.0, members(1.0)[0])[None]
    assert torch.equal(perimeter_likelihood(wide, rock), perimeter_likelihood(members(1.0), rock))


def test_hot_spots_weigh_by_pixels_that_burn_or_burned_lately():
    sensor = HotSpotSensor(pixel=60.0, detection=1.0, false_alarm=0.0, lately=10.0)
    seen = front()
    assert sensor.side(30.0) == 2
    right = hot_spot_likelihood(members(0.5, 1.0, 2.0), seen.burned, seen, sensor, 30.0)
    assert right.argmax() == 1 and float(right[1]) == pytest.approx(0.0, abs=0.1)
    # what burned 55 minutes before is cold after one minute: the member says no pixel near the middle
    cold = hot_spot_likelihood(members(1.0), seen.burned, seen, HotSpotSensor(pixel=60.0, lately=1.0 / 60.0), 30.0)
    assert float(cold) < float(right[1]) - 3.0


def test_missed_pixels_are_expected_by_the_sensor_s_detection():
    seen = front()
    half = seen.burned & (((ROWS + COLUMNS) // 2 % 2) == 0)
    sharp, dull = (HotSpotSensor(pixel=30.0, detection=each, false_alarm=0.0) for each in (1.0, 0.5))
    told = [float(hot_spot_likelihood(members(1.0), half, seen, sensor, 30.0)) for sensor in (sharp, dull)]
    assert told[1] > told[0] + 1.0
    with pytest.raises(ValueError, match="false_alarm must be under detection"):
        HotSpotSensor(detection=0.2, false_alarm=0.3)


def test_cells_beside_share_a_side():
    cells = torch.zeros(3, 3, dtype=torch.bool)
    cells[1, 1] = True
    assert beside(cells).int().tolist() == [[0, 1, 0], [1, 0, 1], [0, 1, 0]]
