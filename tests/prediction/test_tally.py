"""Passing and counting, in numbers worked out by hand."""

import pytest
import torch

from tests.world.backends.test_growing import land, lit
from warp_torchrl.prediction.counts import Counter
from warp_torchrl.prediction.tally import Tally
from warp_torchrl.system import memory
from warp_torchrl.world.fires.alone import Burned, Fires
from warp_torchrl.world.fires.spell import Spell
from warp_torchrl.world.law.passing import HeadBehaviour, passing, steepness_from
from warp_torchrl.world.law.rate import RateFire
from warp_torchrl.world.law.travel import NEVER
from warp_torchrl.world.state.window import Window

SIZE = (6, 8)


def counter(area=None, minutes=(60.0, 60.0), size=SIZE):
    spells = [Spell(torch.tensor([3.0, 0.0]), each) for each in minutes]
    fires = Fires(fire=RateFire(model="fbp"), landscape=land(0, size), spells=spells, cell_size=50.0)
    return Counter(fires=fires, lit=lit(size, (2, 2), (2, 4)), minutes=sum(minutes), area=area)


def burned(*fires):
    """Fires by the minutes at which they came to cells (row, column) of the map."""
    times = torch.full((len(fires), *SIZE), NEVER)
    for number, cells in enumerate(fires):
        for (row, column), minutes in cells.items():
            times[number, row, column] = minutes
    return Burned(Window.whole(SIZE), times, torch.ones_like(times), counter().fires)


def test_rates_are_held_between_rear_and_head_and_intensity_goes_with_them():
    # 50 m in 10, 1 and 1000 minutes; heads of 10 m/min, rears of 1 m/min, 3000 kW/m, flames of 3 m
    then = HeadBehaviour(*(torch.full((3,), value) for value in (10.0, 1.0, 3000.0, 3.0)))
    rate, intensity, flame = passing(torch.tensor([10.0, 1.0, 1000.0]), torch.ones(3), then, 50.0)
    assert rate.tolist() == pytest.approx([5.0, 10.0, 1.0])
    assert intensity.tolist() == pytest.approx([1500.0, 3000.0, 300.0])
    assert flame.tolist() == pytest.approx([3.0 * 0.5**0.46, 3.0, 3.0 * 0.1**0.46])
    # a fire whose times are twice as long has half the rates of head and rear
    slow, _, _ = passing(torch.tensor([10.0, 1.0, 1000.0]), torch.full((3,), 2.0), then, 50.0)
    assert slow.tolist() == pytest.approx([5.0, 5.0, 0.5])


def test_the_steeper_of_row_and_column_and_corner_counts():
    around = torch.full((8, 3), NEVER)
    around[0, 0], around[6, 0] = 6.0, 7.0  # north 4 before, west 3 before: 5
    around[1, 1] = 0.0  # across the corner in the north-east, 10 before
    around[4, 2] = 12.0  # later ones do not count
    found = steepness_from(around, torch.full((3,), 10.0))
    assert found.tolist() == pytest.approx([5.0, 10.0 / 2.0**0.5, 0.0])


def test_areas_progress_and_edges_are_counted_by_the_hour():
    count = counter()
    found = count(burned({(2, 2): 0.0, (2, 4): 0.0, (2, 5): 60.0, (2, 6): 61.0}, {(2, 2): 0.0, (0, 3): 119.0}))
    assert count.hours.tolist() == [0.0, 1.0, 2.0] and count.middle.tolist() == [2.0, 3.0]
    assert found.area.tolist() == [[0.5, 0.75, 1.0], [0.25, 0.25, 0.5]]  # cells of a quarter of a hectare
    assert found.final.tolist() == [1.0, 0.5]
    assert found.progress.tolist() == [[50.0, 100.0, 150.0], [50.0, 50.0, 100.0]]
    assert found.left.tolist() == [False, True] and found.followed.tolist() == [120.0, 120.0]
    assert found.came[2].tolist() == [0.0, 0.0, 2.0, 0.0, 1.0, 1.0, 1.0, 0.0]
    assert bool((found.sums[:, 2, 2] == 0.0).all()), "what was lit has no rate"


@pytest.mark.parametrize("place", [(0, 3), (5, 3), (3, 0), (3, 7)])
def test_each_side_of_the_map_is_an_edge(place):
    assert counter()(burned({place: 5.0})).left.tolist() == [True]
    assert counter()(burned({(1, 1): 5.0, (4, 6): 5.0})).left.tolist() == [False]


def test_a_fire_is_followed_to_its_area():
    count = counter(area=0.7)  # three cells
    found = count(burned({(2, 2): 0.0, (2, 3): 30.0, (3, 3): 50.0, (3, 4): 50.5}, {(2, 2): 0.0}))
    assert count.most_cells == 3 and found.followed.tolist() == [50.0, 120.0]
    assert found.final.tolist() == [0.75, 0.25] and float(found.first[3, 4]) == pytest.approx(NEVER)


def test_windows_of_different_fires_make_one_map():
    tally, size = Tally(2, 120.0), (200, 300)
    count = counter(size=size)
    parts = {(10, 70): 30.0, (150, 200): 90.0}
    for (row, column), minutes in parts.items():
        window = Window.about(lit(size, (row, column)))
        times = torch.full((1, window.height, window.width), NEVER)
        times[0, row - window.top, column - window.left] = minutes
        tally.add(count(Burned(window, times, torch.ones_like(times), count.fires)))
    seen, window = tally.burn_probability(), tally.window
    arrivals = tally.arrivals()
    for (row, column), minutes in parts.items():
        place = row - window.top, column - window.left
        assert float(seen[place]) == 0.5 and float(arrivals.median[place]) == pytest.approx(minutes, abs=2e-3)
        assert float(arrivals.half[place]) == pytest.approx(minutes, abs=2e-3)  # one of two
    assert float(seen.sum()) == 1.0 and int((~arrivals.median.isnan()).sum()) == 2
    assert not bool(tally.first[150 - window.top, 200 - window.left] > 0.0)
    assert tally.joined("final").tolist() == [0.25, 0.25]


def test_fires_that_burn_in_another_order_are_told_in_their_own():
    tally, count = Tally(3, 120.0, torch.tensor([2, 0, 1])), counter()
    for minutes in ((30.0,), (60.0, 90.0)):  # fire 2, then fires 0 and 1
        tally.add(count(burned(*({(2, 2): 0.0, (3, 3): each} for each in minutes))))
    assert tally.every()[:, 3, 3].tolist() == pytest.approx([60.0, 90.0, 30.0], abs=2e-3)
    assert float(tally.first[3, 3]) == 60.0 and tally.at_once == 2
    assert tally.joined("area")[:, 1].tolist() == [0.5, 0.25, 0.5]


def test_times_of_many_fires_that_memory_does_not_hold_are_refused(monkeypatch):
    tally, count = Tally(1000, 120.0), counter()(burned({(2, 2): 0.0}))
    monkeypatch.setattr(memory, "available", lambda: 2 * 1000 * 48)
    tally.add(count)
    monkeypatch.setattr(memory, "available", lambda: 2 * 999 * 48 - 1)
    with pytest.raises(ValueError, match="memory must hold the arrival times of 999 fires in 6 x 8 cells"):
        tally.add(count)


def arrivals(*columns):
    """Return when fires came to cells of a row, by the minutes of each fire in each cell; None where it did not."""
    fires = [{(4, at): time for at, time in enumerate(row) if time is not None} for row in zip(*columns, strict=True)]
    tally = Tally(len(fires), 120.0)
    tally.add(counter()(burned(*fires)))
    return tally.arrivals()


def test_quantiles_are_places_in_the_order_of_the_fires_that_came():
    # 11 fires at minutes 0, 10 ... 100 in the first cell, and 5 of 11 in the second, 6 in the third, in no order
    minutes = [30.0, 0.0, 100.0, 70.0, 10.0, 20.0, 90.0, 40.0, 50.0, 80.0, 60.0]
    times = arrivals(*([each if each < most else None for each in minutes] for most in (101.0, 50.0, 60.0)))
    assert times.median[4, :3].tolist() == pytest.approx([50.0, 20.0, 25.0], abs=0.01)
    assert times.early[4, :3].tolist() == pytest.approx([10.0, 4.0, 5.0], abs=0.01)
    assert times.late[4, :3].tolist() == pytest.approx([90.0, 36.0, 45.0], abs=0.01)
    assert times.half[4, [0, 2]].tolist() == pytest.approx([50.0, 50.0], abs=0.01)
    assert times.half[4, 1].isnan(), "5 of 11 are not half"


def test_of_an_even_number_the_half_is_there_when_the_first_half_has_come():
    assert float(arrivals([10.0, 20.0, 30.0, None]).half[4, 0]) == pytest.approx(20.0, abs=0.01)
