"""Fires in windows come to the times of the whole map, to the bit."""

from dataclasses import replace

import pytest
import torch

from warp_torchrl.system import memory
from warp_torchrl.world.arrays.random import world_key
from warp_torchrl.world.backends import spells as spells_module
from warp_torchrl.world.backends.spells import Highest, strips
from warp_torchrl.world.backends.spreading import Spreading
from warp_torchrl.world.fires import alone
from warp_torchrl.world.fires import parts as parts_module
from warp_torchrl.world.fires.alone import Fires
from warp_torchrl.world.fires.arrival_minutes import arrival_minutes, on_map
from warp_torchrl.world.fires.spell import Spell
from warp_torchrl.world.law.rate import RateFire
from warp_torchrl.world.law.travel import NEVER
from warp_torchrl.world.state import window as window_module
from warp_torchrl.world.state.state import Landscape
from warp_torchrl.world.state.window import Window


@pytest.fixture(autouse=True)
def small_windows(monkeypatch):
    monkeypatch.setattr(window_module, "SIDE", 16)
    monkeypatch.setattr(spells_module, "_STRIP", 1000)


def land(seed, size, relief=True):
    """A map of patches of fuel on hills, with patches that stop a fire."""
    draws = torch.Generator().manual_seed(seed)
    height, width = size
    patches = torch.tensor([2, 3, 11, 4, 102])[torch.randint(5, (height // 5 + 1, width // 5 + 1), generator=draws)]
    fuel = patches.repeat_interleave(5, 0).repeat_interleave(5, 1)[:height, :width].to(torch.int16)
    rise = torch.cumsum(torch.randn(1, height, width, generator=draws), 1) * 4.0
    cover = torch.full((1, height, width), 3, dtype=torch.uint8)
    return Landscape(cover, cover * 3 + 1, rise if relief else None).with_layers(fuel=fuel[None].clone())


def lit(size, *places):
    cells = torch.zeros(size, dtype=torch.bool)
    for row, column in places:
        cells[row, column] = True
    return cells


def turning(count, speed=6.0, minutes=30.0):
    angles = torch.arange(float(count)) * 2.4
    return [Spell(speed * torch.stack((angle.cos(), angle.sin())), minutes) for angle in angles]


def on_whole_map(fire, ground, cells, key, weather):
    fuel = (fire.flammability(ground)[0] > 0.0) & (ground.age[0] >= fire.youngest_fuel)
    worlds = Spreading(cells.expand(len(key), *fuel.shape), fuel, fire.pace(key, tuple(fuel.shape)))
    fires = Fires(fire=fire, landscape=ground, spells=weather, cell_size=30.0)
    worlds.burn([fires.hour(number) for number in range(len(weather))])
    return worlds.arrival()


CASES = {
    "in the middle": (1, (70, 150), ((35, 70),)),
    "at the north-west corner": (2, (70, 150), ((0, 0),)),
    "at the south-east corner": (3, (71, 151), ((70, 150), (64, 140))),
    "at two places apart": (4, (90, 200), ((30, 70), (50, 110))),
    "on a narrow map": (6, (150, 33), ((60, 16), (64, 20))),
}


SLOW = {"in the middle", "at the north-west corner"}  # other cases come to these sides too


@pytest.mark.parametrize("case", [pytest.param(case, marks=[pytest.mark.slow] * (case in SLOW)) for case in CASES])
def test_times_are_those_of_the_whole_map_to_the_bit(case):
    seed, size, places = CASES[case]
    fire = RateFire(model="fbp", cell_deviation=0.3, fire_deviation=0.2)
    ground, key, cells = land(seed, size, relief=seed != 4), world_key(torch.arange(2) + seed), lit(size, *places)
    ground.layer("fuel")[0][cells] = 2
    fires = Fires(fire=fire, landscape=ground, spells=turning(3), cell_size=30.0)
    whole, found = on_whole_map(fire, ground, cells, key, fires.spells), fires.burn(cells, key)
    assert torch.equal(on_map(found), whole)
    assert int((whole < NEVER / 2).sum()) > 100 and found.window.cells < size[0] * size[1], "it takes the whole map"


def test_the_window_grows_to_the_sides_that_the_fire_nears():
    fire, size = RateFire(model="fbp", cell_deviation=0.0), (100, 300)
    ground = land(1, size, relief=False).with_layers(fuel=torch.full((1, *size), 2, dtype=torch.int16))
    cells = lit(size, (50, 40))
    fires = Fires(fire=fire, landscape=ground, spells=[Spell(torch.tensor([6.0, 0.0]), 60.0)], cell_size=30.0)
    first, grown = Window.about(cells), fires.burn(cells, world_key(torch.arange(1))).window
    assert (grown.left, grown.width) == (first.left, 2 * first.width) and grown.height < 60


def test_a_fire_that_is_out_asks_for_no_more_weather():
    fire, size = RateFire(model="fbp", cell_deviation=0.0), (40, 300)
    ground = land(1, size, relief=False).with_layers(fuel=torch.full((1, *size), 102, dtype=torch.int16))
    ground.layer("fuel")[:, 10:13, 100:103] = 2
    asked = []
    fire.__dict__["bed"] = _Listening(fire.bed, asked)
    fires = Fires(fire=fire, landscape=ground, spells=turning(9, minutes=60.0), cell_size=30.0)
    found = fires.burn(lit(size, (11, 101)), world_key(torch.arange(1)))
    assert int((found.minutes < NEVER / 2).sum()) == 9 and len({tuple(wind) for wind in asked}) < 3
    assert fires.n_met < 3


class _Listening:
    """A fuel bed that writes down the winds that it is asked about."""

    def __init__(self, bed, asked):
        self._bed, self._asked = bed, asked

    def spread(self, landscape, wind, *rest, **named):
        self._asked.append(wind.flatten().tolist())
        return self._bed.spread(landscape, wind, *rest, **named)

    def __getattr__(self, name):
        return getattr(self._bed, name)


def started(seed=7, size=(80, 130), weather=4):
    ground = land(seed, size)
    cells = lit(size, *((40 + row, 50 + column) for row in range(3) for column in range(3)))
    ground.layer("fuel")[0][cells] = 2
    fire = RateFire(model="fbp", cell_deviation=0.3)
    return Fires(fire=fire, landscape=ground, spells=turning(weather), cell_size=30.0), cells


def test_fires_that_stop_at_an_area_have_burned_what_they_would_have_by_then():
    (fires, cells), key = started(), world_key(torch.arange(2))
    every, some = (on_map(fires.burn(cells, key, most)) for most in (None, 60))
    last = every.flatten(1).kthvalue(60, dim=1).values[:, None, None]
    assert bool((last < NEVER / 2).all())
    assert torch.equal(torch.where(every <= last, every, NEVER), torch.where(some <= last, some, NEVER))
    assert int((some < NEVER / 2).sum()) < 0.6 * int((every < NEVER / 2).sum())


@pytest.mark.slow
def test_too_many_fires_for_their_window_go_on_in_parts(monkeypatch):
    (fires, cells), key = started(8, weather=3), world_key(torch.arange(3))
    whole = torch.cat(list(arrival_minutes(fires.fire, fires.landscape, cells, key, fires.spells, 30.0)))
    monkeypatch.setattr(parts_module, "_MOST_CELLS", 2 * 19 * 64)
    parts = list(fires.in_parts(cells, key, lambda burned: (burned.window, on_map(burned))))
    assert len(parts) == 3 and torch.equal(torch.cat([minutes for _, minutes in parts]), whole)


def test_threads_change_nothing_and_end_with_an_error(monkeypatch):
    monkeypatch.setattr(alone, "AT_ONCE", 1)
    (fires, cells), key = started(), world_key(torch.arange(2))
    fires = replace(fires, spells=turning(1, minutes=15.0))
    one, two = (list(replace(fires, workers=workers).in_parts(cells, key, on_map)) for workers in (1, 2))
    assert len(two) == 2 and torch.equal(torch.cat(one), torch.cat(two)) and int((two[1] < NEVER / 2).sum()) > 12

    def full(burned):
        raise OSError(28, "No space left on device")

    with pytest.raises(OSError, match="No space left"):
        list(replace(fires, workers=2).in_parts(cells, key, full))


def test_a_window_that_memory_does_not_hold_is_refused_in_one_line(monkeypatch):
    (fires, cells), key = started(), world_key(torch.arange(2))
    monkeypatch.setattr(memory, "available", lambda: 100_000)
    with pytest.raises(
        ValueError, match=r"^memory must hold a fire in a window of \d+ x \d+ cells, which wants 0.0 GB"
    ):
        list(fires.in_parts(cells, key, lambda burned: burned))


@pytest.mark.parametrize("size", [(71, 149), (70, 159), (130, 95)])
def test_rates_of_a_window_are_those_of_the_whole_map_to_the_bit(size):
    ground = land(1, size).with_layers(fuel=torch.full((1, *size), 2, dtype=torch.int16))
    fires = Fires(fire=RateFire(model="fbp"), landscape=ground, spells=turning(8), cell_size=30.0)
    windows = [Window(0, 0, 20, 64, size), Window(30, 64, size[0] - 30, 128, size), Window(9, 0, 33, 192, size)]
    for number in range(8):
        whole = fires.planes(number, Window.whole(size))[0]
        for window in windows:
            found, inside = fires.planes(number, window)[0], window.on_map
            part = whole[:, window.top : window.top + window.height, window.left : window.left + inside.width]
            assert torch.equal(found[:, :, : inside.width], part), (number, window)


def test_strips_have_each_row_once_and_fill_vectors():
    for size in ((5, 7), (130, 33), (1000, 37), (64, 64)):
        rows = [range(strip.top, strip.top + strip.height) for strip in strips(size)]
        assert [row for each in rows for row in each] == list(range(size[0]))
        assert all(len(each) * size[1] % 32 == 0 for each in rows[:-1])


def test_the_least_of_the_highest_is_that_of_all():
    numbers = torch.randn(5000, generator=torch.Generator().manual_seed(0)).round(decimals=1)
    for count in (1, 7, 500, 5000):
        highest = Highest(count)
        for part in numbers.split(137):
            highest.add(part)
        assert highest.least == float(numbers.sort(descending=True).values[count - 1])


def test_windows_are_cut_put_and_joined():
    plane = torch.arange(12.0).view(3, 4)
    size = (3, 4)
    window = Window(1, 0, 2, 64, size)
    assert torch.equal(window.cut(plane, -1.0)[:, :5], torch.tensor([[4.0, 5, 6, 7, -1], [8, 9, 10, 11, -1]]))
    around = torch.tensor([[0.0, 0, 1], [4, 4, 5], [8, 8, 9], [8, 8, 9]])
    assert torch.equal(window.around(plane, margin=1)[:, :3], around)
    assert torch.equal(window.put(window.cut(plane, -1.0), torch.zeros(size))[1:], plane[1:])
    assert window.index().view(2, 64)[:, :5].tolist() == [[4, 5, 6, 7, 7], [8, 9, 10, 11, 11]]
    assert window.joined(Window(0, 0, 1, 64, size)).is_whole and not window.is_whole
    assert [int(side.sum()) for side in window.rim()] == [64, 0, 0, 0]
    far = Window.about(lit((500, 500), (100, 300)))
    assert far.left % 64 == 0 == far.width % 64 and far.top <= 100 - 8 and far.top + far.height > 108
