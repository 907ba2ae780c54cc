"""The laws that the fire must obey as a whole, with the numbers that they give.

Seeds are fixed, so a law passes or fails for good; a rate of false alarms is that over other seeds. A number comes with
its deviation from seed to seed, found from six seeds.
"""

import math
from itertools import pairwise

import pytest
import torch
from torch import Tensor

from warp_torchrl.world.air.wind import Uniform, constant_wind
from warp_torchrl.world.backends.tick import in_wind
from warp_torchrl.world.fires.burn import burn, start_burning, trace
from warp_torchrl.world.law.fire import Fire
from warp_torchrl.world.law.hazard import HazardFire
from warp_torchrl.world.law.rate import RateFire
from warp_torchrl.world.law.wind_and_slope import length_to_breadth
from warp_torchrl.world.state.cells import is_burning
from warp_torchrl.world.state.state import Landscape, WorldState

CALM = Uniform(speed=0.0)
SLOW = pytest.mark.slow


def grassland(
    fire: Fire,
    size: tuple[int, int],
    lit: tuple[int, int],
    *,
    worlds: int,
    wind: Uniform = CALM,
    degrees: float = 0.0,
    radius: int = 1,
    cover: int = 2,
    seed: int = 0,
) -> WorldState:
    """Return worlds of old trees on ground of one cover that climbs to the east, a patch of them on fire."""
    cells = torch.full((worlds, *size), 10, dtype=torch.uint8)
    cells[:, lit[0] - radius : lit[0] + radius + 1, lit[1] - radius : lit[1] + radius + 1] = 11
    climb = 30.0 * math.tan(math.radians(degrees)) * torch.arange(float(size[1]))
    return start_burning(
        Landscape(torch.full_like(cells, cover), cells, climb.expand(worlds, *size) if degrees else None),
        wind=wind,
        fire=fire,
        first_tick=0,
        stage_age=None,
        seed=seed,
        cell_size=30.0,
    )


def hazard_fire(ticks_to_spread: int, hazard: float = 0.05, **options: object) -> HazardFire:
    """Return a fire of calm hazard 0.05 a tick from each neighbour, whose cells spread for so many ticks."""
    stages = 5 if ticks_to_spread % 5 == 0 and ticks_to_spread % 4 else 4
    refinement = ticks_to_spread // stages
    alpha = -math.expm1(-hazard * refinement)
    return HazardFire(refinement=refinement, burning_stages=stages, alpha=(0.0, 0.0, alpha, 0.0, 0.0), **options)


# Fronts.


@pytest.mark.parametrize("neighbours", [8, 4])
def test_a_certain_fire_s_front_is_a_square(neighbours: int) -> None:
    # alpha 1, calm, flat, unit diagonal: after t ticks just the cells within t moves of a king (or of a rook's single
    # steps) have caught fire. So a king's fire is exactly sqrt(2) times as fast along the diagonal.
    fire, side = Fire(diagonal="unit", neighbours=neighbours), 25
    history = trace(grassland(fire, (side, side), (12, 12), worlds=1, radius=0), fire, CALM, 12, 30.0)
    place = (torch.arange(side) - 12).abs()
    king, rook = torch.maximum(place[:, None], place[None, :]), place[:, None] + place[None, :]
    distance = king if neighbours == 8 else rook
    assert torch.equal(history.arrival[0], torch.where(distance <= 12, distance, -1).to(torch.int32))


def diagonal_over_axis(fire: Fire, ticks: int, seed: int = 0) -> float:
    """Return the speed of a calm, flat fire along the diagonals over that along the axes."""
    side, middle = 67, 33
    state = grassland(fire, (side, side), (middle, middle), worlds=24, seed=seed)
    arrival = trace(state, fire, CALM, ticks, 30.0).mean_arrival()

    def time_between(near: int, far: int, directions: list[tuple[int, int]]) -> float:
        times = [
            arrival[middle + far * row, middle + far * column] - arrival[middle + near * row, middle + near * column]
            for row, column in directions
        ]
        return torch.stack(times).mean().item()

    axis = time_between(10, 30, [(0, 1), (0, -1), (1, 0), (-1, 0)]) / 20.0
    diagonal = time_between(7, 21, [(1, 1), (1, -1), (-1, 1), (-1, -1)]) / (14.0 * math.sqrt(2.0))
    return axis / diagonal


@pytest.mark.parametrize(("alpha", "paper_ticks"), [pytest.param(0.33, 40, marks=SLOW), (0.8, 20)])
def test_under_law_hazard_a_calm_fire_is_round(alpha: float, paper_ticks: int) -> None:
    # Diagonal over axis in [0.95, 1.06]: 1.014 +- 0.008 for alpha 0.33 and 1.001 +- 0.010 for 0.8, so the bounds lie
    # four deviations away or more; false alarm under 1e-4.
    fire = HazardFire(alpha=(0.0, 0.0, alpha, 0.0, 0.0), refinement=8)
    assert 0.95 <= diagonal_over_axis(fire, 8 * paper_ticks) <= 1.06


def test_under_law_paper_distance_alone_does_not_make_a_fire_round() -> None:
    # A diagonal neighbour's chance over sqrt(2) still gives fronts that are faster on the diagonal, 1.197 +- 0.007; a
    # fire scientist takes law hazard.
    assert diagonal_over_axis(Fire(alpha=(0.0, 0.0, 0.8, 0.0, 0.0)), 60) > 1.06


# Wind.


def head_speed(fire: Fire, metres_a_second: float, ticks: int, seed: int = 0) -> float:
    """Return how fast a fire goes from 10 to 40 cells downwind [cells / tick]."""
    wind = constant_wind(metres_a_second, 0.0)
    state = grassland(fire, (41, 56), (20, 10), worlds=32, wind=wind, seed=seed)
    reached = trace(state, fire, wind, ticks, 30.0).arrival[:, :, 20:51]
    first = torch.where(reached >= 0, reached, ticks).amin(dim=1).float()  # of any row, [B, columns]
    assert (first < ticks).all()
    return 30.0 / (first[:, -1] - first[:, 0]).mean().item()


FIRES = {
    "paper, alexandridis": (Fire(alpha=(0.0, 0.0, 0.15, 0.0, 0.0)), 160),
    "paper, ellipse": (Fire(kernel="ellipse", alpha=(0.0, 0.0, 0.15, 0.0, 0.0)), 160),
    "hazard, alexandridis": (hazard_fire(32, kernel="alexandridis"), 260),
    "hazard, ellipse": (hazard_fire(32, kernel="ellipse"), 260),
}


@pytest.mark.parametrize(
    "name",
    [
        "paper, alexandridis",
        "hazard, ellipse",
        *(pytest.param(name, marks=SLOW) for name in ("paper, ellipse", "hazard, alexandridis")),
    ],
)
def test_a_head_does_not_slow_down_when_the_wind_rises(name: str) -> None:
    # At 0, 5 and 10 m/s, in cells a tick: paper 0.54, 0.56, 0.60 and, with the ellipse, 0.54, 0.73, 1.00; hazard 0.226,
    # 0.236, 0.248 and 0.226, 0.277, 0.585; all +- 0.005 to 0.011. The smallest step is 1.3 deviations of a difference.
    fire, ticks = FIRES[name]
    speeds = [head_speed(fire, metres_a_second, ticks) for metres_a_second in (0.0, 5.0, 10.0)]
    assert speeds == sorted(speeds), speeds


def length_over_breadth(metres_a_second: float, diagonal: bool, seed: int = 0, kernel: str = "ellipse") -> float:
    """Return length over breadth of fires when their heads have come far, from 3 x 3 cells; the mean over worlds."""
    fire = hazard_fire(30, kernel=kernel)
    angle = math.pi / 4 if diagonal else 0.0
    east, north = math.cos(angle), math.sin(angle)
    reach, ticks = {0.0: (42, 250), 2.5: (42, 260), 5.0: (70, 310), 7.5: (70, 220), 10.0: (70, 160)}[metres_a_second]
    long = reach + 45
    size, lit = ((long, long), (long - 21, 20)) if diagonal else ((81, long), (40, 30))
    if metres_a_second == 0.0:
        size, lit = (121, 121), (60, 60)
    wind = constant_wind(metres_a_second * east, metres_a_second * north)
    state = grassland(fire, size, lit, worlds=16, wind=wind, seed=seed)
    arrival = trace(state, fire, wind, ticks, 30.0).arrival
    arrival = torch.where(arrival >= 0, arrival, 10_000)
    down = torch.arange(size[0])[:, None] - lit[0]
    across = torch.arange(size[1])[None, :] - lit[1]
    along, beside = across * east - down * north, across * north + down * east
    there = (along >= reach) & (beside.abs() <= 8)
    head = torch.where(there, arrival, 10_000).flatten(1).amin(dim=1)
    assert (head < 10_000).all()
    burned = arrival <= head[:, None, None]
    assert not (burned[:, 0] | burned[:, -1]).any() and not (burned[:, :, 0] | burned[:, :, -1]).any()

    def extent(place: Tensor) -> Tensor:
        far = torch.where(burned, place, -math.inf).flatten(1).amax(dim=1)
        return far - torch.where(burned, place, math.inf).flatten(1).amin(dim=1) + 1.0

    return (extent(along) / extent(beside)).mean().item()


@pytest.mark.parametrize(
    ("metres_a_second", "diagonal"),
    [
        (0.0, False),
        (5.0, True),
        (10.0, False),
        *(pytest.param(*each, marks=SLOW) for each in ((0.0, True), (5.0, False), (10.0, True))),
        *(pytest.param(speed, diagonal, marks=SLOW) for speed in (2.5, 7.5) for diagonal in (False, True)),
    ],
)
def test_ellipses_have_the_canadian_length_to_breadth(metres_a_second: float, diagonal: bool) -> None:
    # Calm hazard 0.05 a tick, 30 spreading ticks: within 20 % of the curve along the axes, 30 % at 45 degrees. Over
    # six seeds the ratio is 1.00, 0.86, 0.84, 0.91, 0.92 along an axis at 0, 2.5, 5, 7.5, 10 m/s, and 1.00, 0.94,
    # 1.03, 1.13, 1.13 at 45 degrees, with a deviation of 0.01 to 0.04 from seed to seed: at 5 m/s along an axis one
    # seed in twenty would be out.
    wanted = length_to_breadth(torch.tensor(metres_a_second)).item()
    ratio = length_over_breadth(metres_a_second, diagonal) / wanted
    allowed = 0.3 if diagonal else 0.2
    assert 1.0 - allowed <= ratio <= 1.0 + allowed


# Burned area, by the wind.

HAZARDS = [(24, 150, 1.2), (12, 75, 1.1), (8, 60, 1.02)]  # a refinement, ticks and a factor
BEARINGS = [0.0, 22.5, 45.0]


def burned_by(fire: Fire | RateFire, metres_a_second: float, bearing: float, ticks: int, seed: int = 0) -> float:
    """Return how much of a forest has burned after so many ticks, from 3 x 3 cells [cells]."""
    speed, angle = metres_a_second, math.radians(bearing)
    wind = constant_wind(speed * math.cos(angle), speed * math.sin(angle))
    side, lit = (97, (48, 48)) if speed < 5.0 else (190, (150, 40))  # no fire leaves the map
    state = grassland(fire, (side, side), lit, worlds=8, wind=wind, seed=seed, cover=3)
    burned = trace(state, fire, wind, ticks, 30.0).arrival >= 0
    assert not any(side.any() for side in (burned[:, 0], burned[:, -1], burned[:, :, 0], burned[:, :, -1]))
    return burned.sum(dim=(1, 2)).float().mean().item()


@pytest.mark.parametrize(
    ("refinement", "ticks", "factor", "bearing"),
    [
        pytest.param(*hazard, bearing, marks=[] if near == far else [SLOW])
        for near, hazard in enumerate(HAZARDS)
        for far, bearing in enumerate(BEARINGS)
    ],
)
def test_under_law_hazard_more_wind_burns_more(refinement: int, ticks: int, factor: float, bearing: float) -> None:
    # In coarser ticks heads of 8 m/s and more are near a cell a tick, which no fire passes.
    fire = HazardFire(refinement=refinement)
    areas = [burned_by(fire, speed, bearing, ticks) for speed in (0.0, 2.0, 4.0, 8.0, 12.0)]
    assert all(later > factor * earlier for earlier, later in pairwise(areas)), areas


# Slope.


def uphill_speed(degrees: float, seed: int = 0) -> float:
    """Return how fast a fire goes up a slope, from 20 to 60 cells [cells / tick]."""
    fire = hazard_fire(20)
    state = grassland(fire, (41, 76), (20, 8), worlds=16, degrees=degrees, seed=seed)
    arrival = trace(state, fire, CALM, 330, 30.0).mean_arrival()[20]
    return 40.0 / (arrival[68] - arrival[28]).item()


def test_ten_degrees_uphill_double_the_speed() -> None:
    # Calm hazard 0.05 a tick, 20 spreading ticks, a = 0.115: between 1.8 and 2.2. Found 2.00 +- 0.04; false alarm 6e-7.
    assert 1.8 <= uphill_speed(10.0) / uphill_speed(0.0) <= 2.2


def test_a_fire_that_climbs_hardly_goes_down() -> None:
    # From the middle of a slope of 10 degrees: exp(-1.15) = 0.32 of the hazard downhill is below what a fire needs.
    fire = hazard_fire(20)
    state = grassland(fire, (41, 61), (20, 30), worlds=16, degrees=10.0)
    probability = trace(state, fire, CALM, 120, 30.0).burn_probability()[20]
    assert probability[50] > 0.9
    assert probability[10] < 0.1


# Percolation: a fire that passes on too little dies.


def burned_share(transmission: float, worlds: int, side: int) -> Tensor:
    """Return the share of trees burned in each world, from a 7 x 7 fire in the middle, [B].

    A tree passes the fire to a neighbour with chance 1 - (1 - alpha)^4 over its four spreading stages.
    """
    alpha = 1.0 - (1.0 - transmission) ** 0.25
    fire = Fire(alpha=(0.0, 0.0, alpha, 0.0, 0.0), diagonal="unit")
    state = grassland(fire, (side, side), (side // 2, side // 2), worlds=worlds, radius=3)
    while is_burning(state.cells).any():
        state = burn(state, fire, CALM, 10)
    return state.burned.float().mean((1, 2))


def test_a_fire_dies_below_the_percolation_threshold_and_spreads_above() -> None:
    # Bond percolation on the king's graph: threshold 0.2504. Measured over 64 worlds: a mean of 0.16 and at most 0.49
    # of the trees at 0.23; at 0.30 a mean of 0.86 and at least 0.81.
    dying, spreading = burned_share(0.23, worlds=8, side=65), burned_share(0.30, worlds=8, side=65)
    assert dying.mean() < 0.3
    assert spreading.min() > 0.7


def test_the_paper_s_wetland_does_burn() -> None:
    # alpha 0.1: 1 - 0.9^4 = 0.344, above the threshold.
    assert burned_share(0.3439, worlds=4, side=49).min() > 0.8


# Slow lightning, instantaneous burning: fires of every size.


def fire_sizes(side: int, worlds: int, strikes: int, settling: int) -> Tensor:
    """Return the trees burned by each strike that hits one, in forests that grow between strikes, [fires].

    0.75 % of the empty cells grow a tree between two strikes; each fire burns out before the next tree grows.
    """
    grow = Fire(p_regrow=0.0075, youngest_fuel=1)
    strike = Fire(youngest_fuel=1, neighbours=4)
    generator = torch.Generator().manual_seed(1)
    everywhere = torch.ones(worlds, dtype=torch.bool)
    state = grassland(strike, (side, side), (side // 2, side // 2), worlds=worlds)
    state = state.replace(cells=(torch.rand(worlds, side, side, generator=generator) < 0.4).to(torch.uint8))
    certain, sizes, world = torch.zeros(worlds, side, side), [], torch.arange(worlds)
    for count in range(strikes):
        state = grow.tick(state, torch.rand(worlds, side, side, generator=generator), everywhere)
        row, column = torch.randint(side, (2, worlds), generator=generator)
        before, hit = (state.cells > 0).sum((1, 2)), state.cells[world, row, column] > 0
        cells = state.cells.clone()
        cells[world, row, column] = 11 * hit.to(torch.uint8)
        state = state.replace(cells=cells)
        while is_burning(state.cells).any():
            for _ in range(10):
                state = strike.tick(state, certain, everywhere)
        if count >= settling:
            sizes.append((before - (state.cells > 0).sum((1, 2)))[hit])
    return torch.cat(sizes)


@pytest.mark.slow
def test_fire_sizes_in_the_limit_of_drossel_and_schwabl_follow_a_power_law() -> None:
    # n(s) ~ s^-tau with tau in [1.0, 1.25] (Drossel and Schwabl 1992; 1.14 to 1.19 in the literature), here the most
    # likely tau over 5..500 trees. Its standard error with 200 fires is 1 / sqrt(200 var(ln s)) = 0.05.
    sizes = fire_sizes(256, worlds=4, strikes=420, settling=150)
    seen = sizes[(sizes >= 5) & (sizes <= 500)].double()
    assert len(seen) > 150
    size = torch.arange(5.0, 501.0, dtype=torch.float64)
    taus = torch.linspace(0.5, 2.0, 301, dtype=torch.float64)
    likelihood = -taus * seen.log().sum() - len(seen) * torch.log((size ** -taus[:, None]).sum(dim=1))
    assert 1.0 <= taus[likelihood.argmax()] <= 1.25


# Probabilities 0 and 1 are exact, whatever the law.


def every_fire() -> list[Fire]:
    options = [
        {"kernel": kernel, "neighbours": neighbours, "diagonal": diagonal, "burning_stages": stages}
        for kernel in ("alexandridis", "ellipse", "fbp")
        for neighbours in (4, 8)
        for diagonal in ("distance", "unit")
        for stages in (4, 5)
    ]
    hazards = [HazardFire(refinement=k, alpha=Fire.alpha, **each) for each in options for k in (1, 8)]
    return [Fire(**each) for each in options] + hazards


def in_short(fire: Fire) -> str:
    kind = f"{type(fire).__name__} {fire.ticks_per_stage}"
    return f"{kind} {fire.kernel} {fire.neighbours} {fire.diagonal} {fire.burning_stages}"


@pytest.mark.parametrize("fire", every_fire(), ids=in_short)
def test_chances_of_nought_and_one_are_exact_for_every_law(fire: Fire) -> None:
    # Twenty worlds of random cells, covers, hills, wet trees and winds. Trees that no spreading neighbour can reach
    # have chance 0, and never ignite with u = 0; chances stay in [0, 1]; under the hardest wind those downwind of a
    # fire have chance 1, and ignite with the largest u.
    generator = torch.Generator().manual_seed(3)

    def random(high: int) -> Tensor:
        return torch.randint(high, (20, 9, 11), generator=generator, dtype=torch.uint8)

    state = start_burning(
        Landscape(age=random(16), cover=random(5), elevation=torch.rand(20, 9, 11, generator=generator) * 60.0),
        wind=Uniform(speed=8.0),
        fire=fire,
        first_tick=0,
        stage_age=None,
        seed=0,
        cell_size=30.0,
    )
    state = state.replace(wet=(random(4) == 0).to(torch.uint8))
    chance = fire.ignition_probability(state)
    assert ((chance >= 0.0) & (chance <= 1.0)).all()
    spreading = (is_burning(state.cells) & (state.cells <= fire.last_spreading)).float()
    reach = (
        torch.tensor([[0.0, 1.0, 0.0], [1.0, 0.0, 1.0], [0.0, 1.0, 0.0]]) if fire.neighbours == 4 else torch.ones(3, 3)
    )
    reached = torch.nn.functional.conv2d(spreading[:, None], reach[None, None], padding=1)[:, 0] > 0.0
    can_burn = (state.cells >= 2) & (state.cells <= 10) & (state.wet == 0) & (state.alpha > 0.0)
    assert torch.equal(chance > 0.0, reached & can_burn)
    everywhere = torch.ones(20, dtype=torch.bool)
    lit = (fire.tick(state, torch.zeros(20, 9, 11), everywhere).cells == 11) & (state.cells < 11)
    assert torch.equal(lit, reached & can_burn)
    gale = in_wind(state, fire, torch.tensor([60.0, 0.0])[None, :, None, None].expand(20, -1, -1, -1))
    sure = fire.ignition_probability(gale) == 1.0
    assert (sure & (chance < 1.0)).any()  # at 8 m/s they were not
    almost_one = torch.full((20, 9, 11), 1.0 - 2.0**-24)
    assert torch.equal((fire.tick(gale, almost_one, everywhere).cells == 11) & sure, sure)
