"""Likelihood of what was seen, by sectors about what had burned."""

import math

import pytest
import torch

from warp_torchrl.world.fires.sightings import (
    Front,
    HotSpotSensor,
    beside,
    hot_spot_sight,
    perimeter_sight,
)

SIDE = 41
ROWS, COLUMNS = torch.meshgrid(torch.arange(SIDE) - 20.0, torch.arange(SIDE) - 20.0, indexing="ij")
FAR = torch.hypot(ROWS, COLUMNS)


def front(known=2.0, burned=8.0):
    return Front(known >= FAR, burned >= FAR, torch.ones(SIDE, SIDE, dtype=torch.bool), 60.0)


def members(*rates):
    """Fires that grow from a circle of 2 cells by a cell in ten minutes."""
    return torch.stack([(FAR - 2.0).clamp(min=0.0) * 10.0 / rate for rate in rates])


def off(sight, arrival):
    """How far members are from what was seen, sum of squares over the sectors."""
    return (sight.of(arrival) - sight.seen).square().sum(1)


def test_the_member_that_grew_as_much_is_nearest_and_half_is_as_far_as_twice():
    found = off(perimeter_sight(front()), members(0.5, 0.8, 1.0, 1.25, 2.0))
    assert found.argmin() == 2 and float(found[2]) == pytest.approx(0.0, abs=0.1)
    assert bool((found[[1, 3]] < found[[0, 4]]).all())


def test_a_sector_s_growth_is_the_logarithm_of_cells_with_half_of_the_front():
    # One old cell, one along the front in the east: one growing cell there, of 4 that the member says.
    known, burned = (torch.zeros(3, 9, dtype=torch.bool) for _ in range(2))
    known[1, 0] = burned[1, 0] = burned[1, 1] = True
    fuel = torch.zeros(3, 9, dtype=torch.bool)
    fuel[1] = True
    arrival = torch.full((1, 3, 9), 99.0)
    arrival[0, 1, :5] = 1.0
    sight = perimeter_sight(Front(known, burned, fuel, 60.0))
    east = int(sight.sector[1, 4])
    # f = 1, a = 1/2, q^2 = 1/2
    assert float(sight.seen[east]) == pytest.approx(math.log(1.5)) and float(sight.none[east]) == pytest.approx(
        math.log(0.5)
    )
    assert float(sight.variance[east]) == pytest.approx(0.5 / 2.25)
    assert float(sight.of(arrival)[0, east]) == pytest.approx(math.log(4.5))


def test_what_cannot_burn_says_nothing():
    seen = front()
    rock = Front(seen.known, seen.burned, seen.fuel & (COLUMNS < 6.0), 60.0)
    wide = torch.where(COLUMNS >= 6.0, 1.0, members(1.0)[0])[None]
    sight = perimeter_sight(rock)
    assert torch.equal(sight.of(wide), sight.of(members(1.0)))


def test_hot_spots_are_pixels_that_burn_or_burned_lately():
    sensor = HotSpotSensor(pixel=60.0, detection=1.0, false_alarm=0.0, lately=10.0)
    seen = front()
    assert sensor.side(30.0) == 2
    found = off(hot_spot_sight(seen, seen.burned, sensor, 30.0), members(0.5, 1.0, 2.0))
    assert found.argmin() == 1 and float(found[1]) == pytest.approx(0.0, abs=0.1)
    # what burned 55 minutes before is cold after one minute: the member says no pixel near the middle
    brief = HotSpotSensor(pixel=60.0, lately=1.0 / 60.0)
    assert float(off(hot_spot_sight(seen, seen.burned, brief, 30.0), members(1.0))) > float(found[1]) + 3.0


def test_missed_pixels_are_expected_by_the_sensor_s_detection():
    seen = front()
    half = seen.burned & (((ROWS + COLUMNS) // 2 % 2) == 0)
    sharp, dull = (HotSpotSensor(pixel=30.0, detection=each, false_alarm=0.0) for each in (1.0, 0.5))
    sights = [hot_spot_sight(seen, half, sensor, 30.0) for sensor in (sharp, dull)]
    assert float(off(sights[1], members(1.0))) < float(off(sights[0], members(1.0)))
    assert bool((sights[1].variance >= sights[0].variance).all())
    with pytest.raises(ValueError, match="false_alarm must be under detection"):
        HotSpotSensor(detection=0.2, false_alarm=0.3)


def test_cells_beside_share_a_side():
    cells = torch.zeros(3, 3, dtype=torch.bool)
    cells[1, 1] = True
    assert beside(cells).int().tolist() == [[0, 1, 0], [1, 0, 1], [0, 1, 0]]
