"""Times of arrival: numbers worked by hand, and ways that are straight, bent or shut."""

import math

import pytest
import torch

from warp_torchrl.world.arrays.geometry import DIRECTIONS
from warp_torchrl.world.law.travel import (
    NEVER,
    NOWHERE,
    Places,
    along_ray,
    arrival,
    duration,
    from_edges,
    least_ratio,
    since,
    travel,
    until,
)


def round_fire(slowness: float = 2.0):
    """The metric of a fire that needs so many minutes for a cell, whichever way."""
    return torch.tensor([slowness]), torch.zeros(1), torch.zeros(1)


def around(times: dict[str, float], otherwise: float = NEVER) -> torch.Tensor:
    """Times of the eight neighbours, [8, 1]."""
    names = ("n", "ne", "e", "se", "s", "sw", "w", "nw")
    return torch.tensor([[times.get(name, otherwise)] for name in names])


def places(row: int, column: int, width: int, times: dict[int, float]) -> Places:
    known = torch.full((width * width,), NEVER)
    for cell, time in times.items():
        known[cell] = time
    return Places(
        torch.tensor([row], dtype=torch.int32),
        torch.tensor([column], dtype=torch.int32),
        width,
        lambda origin: known[origin.long()],
    )


def test_without_wind_a_cell_takes_its_side_over_the_rate() -> None:
    slowness, east, north = travel(torch.tensor([[[10.0]]]), torch.zeros(1, 1, 1), torch.ones(1, 1, 1), 30.0)[0]
    assert slowness.item() == pytest.approx(3.0)  # 30 m at 10 m/min
    assert east.item() == north.item() == 0.0


@pytest.mark.parametrize("bearing", [0.0, 30.0, 90.0, 200.0])
@pytest.mark.parametrize("ratio", [1.0, 2.0, 4.6])
def test_the_ellipse_has_its_head_its_back_and_its_breadth(bearing: float, ratio: float) -> None:
    metric = travel(torch.tensor([[[6.0]]]), torch.full((1, 1, 1), bearing), torch.full((1, 1, 1), ratio), 30.0)[0]
    focus = math.sqrt(1.0 - 1.0 / ratio**2)

    def time(turn: float, cells: float) -> float:
        angle = math.radians(bearing + turn)
        east, north = torch.tensor(cells * math.sin(angle)), torch.tensor(cells * math.cos(angle))
        return duration(tuple(metric), east, north).item()

    assert time(0.0, 1.0) == pytest.approx(5.0, rel=1e-4)  # 30 m at 6 m/min
    assert time(180.0, 1.0) == pytest.approx(5.0 * (1.0 + focus) / (1.0 - focus), rel=1e-4)  # the far end from a focus
    # After 5 minutes the ellipse is 2 / (1 + e) cells long. It is broadest where its middle is: e half lengths ahead.
    half = 1.0 / (1.0 + focus)
    turn = math.degrees(math.atan2(half / ratio, focus * half))
    assert time(turn, math.hypot(half / ratio, focus * half)) == pytest.approx(5.0, rel=1e-4)


def test_where_nothing_burns_fire_never_comes() -> None:
    slowness, *_ = travel(torch.zeros(1, 1, 1), torch.zeros(1, 1, 1), torch.ones(1, 1, 1), 30.0)[0]
    assert slowness.item() == NEVER


def test_fire_comes_from_one_neighbour_by_its_distance() -> None:
    time, direction, _, alone = from_edges(around({"w": 1.0}), round_fire())
    assert (time.item(), direction.item(), alone.item()) == (3.0, 6, True)
    time, direction, _, alone = from_edges(around({"sw": 1.0}), round_fire())
    assert time.item() == pytest.approx(1.0 + 2.0 * math.sqrt(2.0), rel=1e-6)
    assert (direction.item(), alone.item()) == (5, True)


def test_a_straight_front_goes_on_at_its_rate_whichever_way_it_leans() -> None:
    # A front that moves to the south-east at 30 degrees from east: t = 2 (x cos + y sin) for x east and y south.
    slope = (math.cos(math.radians(30.0)), math.sin(math.radians(30.0)))
    times = torch.tensor([[2.0 * (column * slope[0] + row * slope[1]) + 9.0] for row, column in DIRECTIONS])
    ahead = times > 9.0
    time, *_, alone = from_edges(torch.where(ahead, NEVER, times), round_fire())
    assert time.item() == pytest.approx(9.0, abs=1e-5)
    assert not alone.item()


def test_the_wind_carries_the_times_along() -> None:
    # The same front, in a wind: a Randers metric is the round one of T = t + w . x.
    drift = (torch.tensor([0.7]), torch.tensor([-0.3]))
    times = torch.tensor([[2.0 * -abs(row + column) + 9.0] for row, column in DIRECTIONS])
    carried = torch.stack([times[d] - 0.7 * column - 0.3 * row for d, (row, column) in enumerate(DIRECTIONS)])
    still, *_ = from_edges(times, round_fire())
    windy, *_ = from_edges(carried, (torch.tensor([2.0]), *drift))
    assert windy.item() == pytest.approx(still.item(), rel=1e-6)


def test_a_ray_is_exact_from_a_point() -> None:
    # The fire began at (2, 2) of a map of 9 columns; the cell is at (3, 4), neighbours on the way (3, 3) and (2, 3).
    begun = 2 * 9 + 2
    times = around({"w": 2.0 * math.sqrt(2.0), "nw": 2.0})
    origins = torch.full((8, 1), begun, dtype=torch.int32)
    at = places(3, 4, 9, {begun: 0.0})
    time, origin = arrival(times, origins, round_fire(), at)
    assert time.item() == pytest.approx(2.0 * math.sqrt(5.0), rel=1e-6)
    assert origin.item() == begun
    over_edge, *_ = from_edges(times, round_fire())
    assert over_edge.item() > time.item() + 0.05  # what a straight front between the two would be late by


@pytest.mark.parametrize(("shut", "passes"), [("nw", True), ("w", False)])
def test_a_ray_passes_a_cell_that_it_clips_by_less_than_half(shut: str, passes: bool) -> None:
    # The way from (2, 2) to (3, 5) leaves column 4 at 2 + 2/3 rows: two thirds in the cell west of it.
    begun, cells = 2 * 9 + 2, {"w": 2.0 * math.sqrt(5.0), "nw": 4.0}
    origins = torch.full((8, 1), begun, dtype=torch.int32)
    origins[{"w": 6, "nw": 7}[shut]] = NOWHERE
    at = places(3, 5, 9, {begun: 0.0})
    time = along_ray(around(cells), origins, torch.tensor([begun], dtype=torch.int32), round_fire(), at).item()
    assert time == (pytest.approx(2.0 * math.sqrt(10.0), rel=1e-6) if passes else NEVER)


def test_a_ray_goes_on_at_the_mean_slowness_of_its_neighbours() -> None:
    # On a straight way of 3 cells the first 2 took 7 minutes; here a cell takes 2.
    begun = 4 * 9 + 1
    times, origins = around({"w": 7.0}), torch.full((8, 1), begun, dtype=torch.int32)
    at = places(4, 4, 9, {begun: 0.0})
    time = along_ray(times, origins, torch.tensor([begun], dtype=torch.int32), round_fire(), at)
    assert time.item() == pytest.approx(9.0, rel=1e-6)


def test_nothing_comes_from_neighbours_that_never_burn() -> None:
    at = places(3, 4, 9, {})
    time, _ = arrival(around({}), torch.full((8, 1), NOWHERE, dtype=torch.int32), round_fire(), at)
    assert time.item() >= NEVER / 2


def weathers(seed: int, n: int = 64) -> tuple[torch.Tensor, ...]:
    """Two metrics of n cells, in winds that have nothing to do with each other."""
    draws = torch.Generator().manual_seed(seed)
    head, ratio, bearing = (torch.rand(2, n, 1, generator=draws) for _ in range(3))
    made = [travel(1.0 + 20.0 * head[i], 360.0 * bearing[i], 1.0 + 7.0 * ratio[i], 30.0) for i in range(2)]
    return tuple(each.unbind(1) for each in made)


@pytest.mark.parametrize("seed", range(4))
def test_the_least_ratio_of_two_weathers_is_that_of_some_direction(seed: int) -> None:
    before, after = weathers(seed)
    turn = torch.linspace(0.0, 2.0 * math.pi, 3600)
    ratios = duration(after, turn.sin(), turn.cos()) / duration(before, turn.sin(), turn.cos())
    assert torch.allclose(least_ratio(before, after), ratios.amin(1, keepdim=True), rtol=2e-3)
    assert (least_ratio(before, before) == 1.0).all()


@pytest.mark.parametrize("seed", range(4))
def test_in_another_weather_fire_comes_after_it_began_and_in_the_same_when_it_would_have(seed: int) -> None:
    before, after = weathers(seed)
    draws = torch.Generator().manual_seed(seed)
    around, now = 20.0 * torch.rand(8, *before[0].shape, generator=draws), 10.0
    times = now + 5.0 * torch.rand(before[0].shape, generator=draws)
    assert torch.equal(until(times, now, around, before, before), times)
    ratio = (until(times, now, around, before, after) - now) / (times - now)
    assert (ratio >= least_ratio(before, after) * (1.0 - 1e-3)).all() and (ratio > 0.0).all()
    assert torch.equal(since(around, now, torch.ones(())), around)


def test_what_is_left_of_a_cell_takes_the_new_rate_of_its_own_direction() -> None:
    # Fire left the west at 0 and needs 2 minutes for a cell; after 1.5 it needs 9 from there, and 1 from the east.
    before, after = round_fire(2.0), (torch.tensor([5.0]), torch.tensor([-4.0]), torch.zeros(1))
    time = until(torch.tensor([2.0]), 1.5, around({"w": 0.0}), before, after)
    assert time.item() == pytest.approx(1.5 + 0.25 * 9.0)
