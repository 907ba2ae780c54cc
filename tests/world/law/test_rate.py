"""Law rate: ellipses of the told rate, and a fire that is fought."""

import math
from itertools import pairwise, product

import pytest
import torch

from tests.world.drawing import draw, drawn
from warp_torchrl.world.air.wind import Calm, Uniform
from warp_torchrl.world.arrays.random import world_key
from warp_torchrl.world.backends.tick import advance, in_wind
from warp_torchrl.world.fires.arrival_minutes import arrival_minutes
from warp_torchrl.world.fires.spell import Spell, spread_in
from warp_torchrl.world.law import arrivals
from warp_torchrl.world.law.arrivals import arrivals_in
from warp_torchrl.world.law.rate import RateFire
from warp_torchrl.world.law.travel import NEVER
from warp_torchrl.world.state.state import Landscape, WorldState
from warp_torchrl.world.terrain.landscape import Perlin
from warp_torchrl.world.world import World

C2 = 2
EVERY = torch.ones(1, dtype=torch.bool)


def forest(size: int, fuel: int = C2) -> Landscape:
    whole = torch.ones(1, size, size, dtype=torch.uint8)
    return Landscape(whole * 3, whole * 10, None).with_layers(fuel=whole.to(torch.int16) * fuel)


def law(**options: object) -> RateFire:
    return RateFire(**{"model": "fbp", "cell_deviation": 0.0, "minutes_per_tick": 1.0} | options)


def steps(state: WorldState, fire: RateFire, ticks: int) -> WorldState:
    for _ in range(ticks):
        state = advance(state, fire, Calm(), torch.ones(len(state.cells), dtype=torch.bool))
    return state


def start(drawing: str, fire: RateFire, **options: object) -> WorldState:
    return fire.started(draw(drawing, fire=fire, ground=" ".join("f" * len(row) for row in drawing.split()), **options))


SPEEDS = {1.0: 0.0, 2.3: 17.8 / 3.6, 4.6: 36.3 / 3.6}  # m/s, of the Canadian curve of length to breadth
QUICK = {(1.0, 22, 0.0), (2.3, 0, 0.1), (2.3, 33, 0.0), (4.6, 0, 0.0), (4.6, 11, 0.1), (4.6, 22, 0.0), (4.6, 45, 0.1)}
"""Ellipses of the quick suite: a ratio, a bearing and a deviation."""


@pytest.mark.parametrize(
    ("ratio", "bearing", "deviation"),
    [
        pytest.param(*case, marks=[] if case in QUICK else [pytest.mark.slow])
        for case in product(SPEEDS, (0, 11, 22, 33, 45), (0.0, 0.1))
    ],
)
def test_a_fire_on_uniform_ground_is_the_told_ellipse(ratio: float, bearing: int, deviation: float) -> None:
    reach, cell = 60, 30.0
    size, (row, column) = (reach + 30, (reach + 15, 15)) if ratio > 1.0 else (101, (50, 50))
    fire, ground = law(cell_deviation=deviation), forest(size)
    angle, speed = math.radians(bearing), SPEEDS[ratio]
    wind = torch.tensor([speed * math.sin(angle), speed * math.cos(angle)])
    told = spread_in(fire, ground, cell, Spell(wind, 1.0))
    assert told.length_to_breadth[0, 0, 0].item() == pytest.approx(ratio, rel=0.01)
    head = told.head[0, 0, 0].item()
    minutes = (45 if ratio == 1.0 else reach) * cell / head
    lit = torch.zeros(size, size, dtype=torch.bool)
    lit[row, column] = True
    key = world_key(torch.arange(4 if deviation else 1))
    (arrival,) = arrival_minutes(fire, ground, lit, key, [Spell(wind, minutes)], cell)
    burned = (arrival <= minutes).nonzero()
    east, north = (burned[:, 2] - column) * cell, (row - burned[:, 1]) * cell
    along, across = east * math.sin(angle) + north * math.cos(angle), east * math.cos(angle) - north * math.sin(angle)
    heads = [along[burned[:, 0] == fires].max().item() for fires in range(len(key))]
    assert sum(heads) / len(heads) / minutes == pytest.approx(head, rel=0.05)
    moments = torch.cov(torch.stack((along, across)).float())
    lengths, axes = torch.linalg.eigh(moments)
    assert (lengths[1] / lengths[0]).sqrt().item() == pytest.approx(ratio, rel=0.2 if ratio > 4.0 else 0.15)
    if ratio > 1.0:
        lean = math.degrees(math.atan2(axes[1, 1].item(), axes[0, 1].item()))
        assert abs((lean + 90.0) % 180.0 - 90.0) < 3.0


PATCHY = 5.6  # length to breadth at 45 km/h


@pytest.mark.slow
@pytest.mark.parametrize("bearing", [0.0, 22.5, 45.0])
def test_a_narrow_head_runs_on_where_a_tenth_of_the_cells_is_bare(bearing: float) -> None:
    # Straight ways round the bare squares' corners come to 0.95, 0.90 and 0.89 of the told distance on such maps.
    reach, cell, begun, angle = 50, 100.0, (72, 15), math.radians(bearing)
    wind = 12.5 * torch.tensor([math.sin(angle), math.cos(angle)])
    told, shares = spread_in(law(), forest(3), cell, Spell(wind, 1.0)), []
    assert told.length_to_breadth[0, 0, 0].item() == pytest.approx(PATCHY, rel=0.01)
    minutes = reach * cell / told.head[0, 0, 0].item()
    for seed in range(12):
        ground, lit = forest(88), torch.zeros(88, 88, dtype=torch.bool)
        bare = torch.rand(1, 88, 88, generator=torch.Generator().manual_seed(seed)) < 0.1
        lit[begun] = True
        bare[0, 71:74, 14:17] = False
        ground.layer("fuel")[bare] = 101
        (arrival,) = arrival_minutes(law(), ground, lit, world_key(torch.zeros(1).long()), [Spell(wind, minutes)], cell)
        _, row, column = (arrival <= minutes).nonzero().unbind(1)
        along = (column - begun[1]) * math.sin(angle) + (begun[0] - row) * math.cos(angle)
        shares.append(along.max().item() / reach)
    assert 0.7 < sum(shares) / len(shares) < 0.95


def test_a_constant_weather_in_hours_is_one_weather() -> None:
    ground, lit = forest(40), torch.zeros(40, 40, dtype=torch.bool)
    lit[20, 12] = True
    ground.layer("fuel")[0, 14:26:3, 18] = 101
    wind, key = torch.tensor([9.0, 3.0]), world_key(torch.arange(2))
    fire = law(cell_deviation=0.3)
    whole, hours = (
        next(arrival_minutes(fire, ground, lit, key, [Spell(wind, minutes)] * count, 30.0))
        for minutes, count in ((64.0, 1), (16.0, 4))
    )
    burned = whole < NEVER
    assert burned.sum() > 100 and torch.allclose(whole[burned], hours[burned], atol=0.1)


def burned_by(model: str, fuel: int, speed: float, minutes: float) -> int:
    """Return how much of a map of one fuel has burned after so many minutes [cells]."""
    fire, ground = law(model=model), forest(201, fuel)
    wind = speed * torch.tensor([math.cos(0.4), math.sin(0.4)])
    lit = torch.zeros(201, 201, dtype=torch.bool)
    lit[100, 100] = True
    (arrival,) = arrival_minutes(fire, ground, lit, world_key(torch.arange(1)), [Spell(wind, minutes)], 30.0)
    return int((arrival <= minutes).sum())


@pytest.mark.parametrize(
    ("model", "fuel", "minutes", "calmest"),
    [
        pytest.param("fbfm40", 165, 120.0, 0.0, marks=pytest.mark.slow),
        ("fbfm40", 122, 60.0, 0.0),
        pytest.param("fbfm13", 10, 300.0, 0.0, marks=pytest.mark.slow),
        ("fbp", C2, 30.0, 2.0),
    ],
)
def test_more_wind_burns_more(model: str, fuel: int, minutes: float, calmest: float) -> None:
    # The Canadian system's own ellipses are narrower at 1 and 2 m/s than their heads are faster.
    speeds = [speed for speed in (0.0, 1.0, 2.0, 4.0, 8.0, 12.0) if speed >= calmest]
    areas = [burned_by(model, fuel, speed, minutes) for speed in speeds]
    assert all(later > 1.1 * earlier for earlier, later in pairwise(areas)), areas


def test_a_slope_makes_an_ellipse_without_wind() -> None:
    size, fire = 61, law()
    ground = forest(size).replace(elevation=torch.arange(size).flip(0)[None, :, None].expand(1, size, size) * 15.0)
    told = spread_in(fire, ground, 30.0, Spell(torch.zeros(2), 1.0))
    assert told.direction[0, 30, 30].item() == pytest.approx(0.0, abs=0.1)  # uphill, to the north
    lit = torch.zeros(size, size, dtype=torch.bool)
    lit[50, 30] = True
    minutes = 30 * 30.0 / told.head[0, 30, 30].item()
    key, spell = world_key(torch.zeros(1).long()), Spell(torch.zeros(2), 1.1 * minutes)
    (arrival,) = arrival_minutes(fire, ground, lit, key, [spell], 30.0)
    assert arrival[0, 20, 30].item() == pytest.approx(minutes, rel=0.02)


def test_minutes_of_a_tick_follow_from_the_fastest_fire() -> None:
    world = World(landscape=Perlin(size=32), wind=Uniform(speed=8.0), fire=RateFire(model="fbp"))
    fastest = world.fire.bed.fastest(world.landscape, world.air, 30.0, torch.tensor([6.0, 7, 8, 60, 90, 90, 60]))
    assert world.fire.minutes == pytest.approx(15.0 / fastest, rel=0.05)
    given = World(landscape=Perlin(size=32), fire=RateFire(model="fbp", minutes_per_tick=7.0))
    assert given.fire.minutes == 7.0


def test_cells_ignite_at_the_minute_that_the_fire_needs() -> None:
    fire = law(minutes_per_tick=2.0, residence=1000.0)
    state = start("aTTTT", fire)
    rate = fire.bed.spread(state.landscape, state.wind, torch.tensor([[6.0, 7, 8, 60, 90, 90, 60]]), 30.0).head[0, 0, 0]
    cell = 30.0 / rate.item()  # minutes
    for tick in range(1, 30):
        state = steps(state, fire, 1)
        expected = 1 + min(4, int(tick * 2.0 / cell))
        assert (state.cells > 10).sum().item() == expected
    assert arrivals_in(state).minutes[0, 0, 1:3].tolist() == pytest.approx([cell, 2 * cell], rel=1e-5)


def test_the_edge_burns_until_it_has_nowhere_to_go() -> None:
    fire = law(residence=5.0)
    state = steps(start("aTT", fire), fire, 3)
    assert fire.ticks_per_stage == 1
    for _ in range(400):
        state = steps(state, fire, 1)
        if drawn(state) == "...":
            break
        front = state.cells[0, 0] > 10
        assert front.any(), "the fire died beside a tree"
    assert drawn(state) == "..."


def test_a_fire_beside_a_wet_tree_burns_out_and_does_not_come_back() -> None:
    fire = law(residence=5.0, wet_minutes=40.0)
    state = start("aT", fire)
    state = steps(state.replace(wet=torch.tensor([[[0, 40]]], dtype=torch.uint8)), fire, 60)
    assert drawn(state) == ".T"


def test_fire_goes_round_a_firebreak_and_not_over_it() -> None:
    fire = law(residence=2000.0, minutes_per_tick=3.0)
    shut = start("aT#TT TT#TT TT#TT", fire)
    assert (steps(shut, fire, 40).cells[0, :, 3:] == 10).all()
    gap = start("aT#TT TT#TT TTTTT", fire)
    after = steps(gap, fire, 40)
    assert (after.cells[0, :, 3:] > 10).all()
    straight, round_it = arrivals_in(steps(start("aTTTT " * 3, fire), fire, 40)), arrivals_in(after)
    assert round_it.minutes[0, 0, 4] > straight.minutes[0, 0, 4] * 1.1


def test_what_is_put_out_sends_no_more_fire() -> None:
    fire = law(residence=2000.0)
    state = steps(start("aTTTT", fire), fire, 3)
    assert drawn(state)[0] == "a" and drawn(state)[1:] == "TTTT"
    out = state.replace(cells=torch.full_like(state.cells, 10), wet=torch.full_like(state.wet, 3))
    assert drawn(steps(out, fire, 60)) == "TTTTT"


def test_in_another_wind_the_fire_goes_on_from_where_it_is() -> None:
    fire = law(residence=2000.0)
    row = "a" + "T" * 9
    slow, fast = (torch.tensor([speed, 0.0])[None, :, None, None] for speed in (2.0, 8.0))

    def minutes_of(first: torch.Tensor, second: torch.Tensor, change: int) -> torch.Tensor:
        state = start(row, fire, wind=first[0])
        state = steps(state, fire, change)
        state = steps(in_wind(state, fire, second), fire, 20 - change)
        return arrivals_in(state).minutes[0, 0]

    one, other = (minutes_of(each, each, 1)[1].item() for each in (slow, fast))
    changed = minutes_of(slow, fast, 4)
    # After 4 minutes a share 4 / one of the first cell is behind the front; the rest goes at the new rate.
    assert changed[1].item() == pytest.approx(4.0 + (1.0 - 4.0 / one) * other, rel=1e-3)
    assert (changed[3] - changed[2]).item() == pytest.approx(other, rel=1e-3)


def test_the_same_wind_again_changes_no_time() -> None:
    fire = law(cell_deviation=0.3)
    state = steps(start("TTTTT TTaTT TTTTT", fire, wind=(3.0, 1.0)), fire, 4)
    again = fire.in_air(state, state.air)
    assert all(torch.equal(*pair) for pair in zip(leaves(again), leaves(state), strict=True))


def leaves(state: WorldState) -> list[torch.Tensor]:
    return list(arrivals_in(state).leaves().values())


@pytest.mark.parametrize("seed", [0, 1, *(pytest.param(seed, marks=pytest.mark.slow) for seed in (2, 3))])
def test_in_winds_that_turn_no_fire_comes_before_its_wind_or_a_tick_late(seed: int) -> None:
    fire, draws = law(cell_deviation=0.3, residence=1e4, minutes_per_tick=0.5), torch.Generator().manual_seed(seed)
    rows = "TTTTTTTT#TTTTTTTTTTT TTTT#TTTTTTTTTT#TTTT TT#TTTTTTTTTT#TTTTTT " * 7
    whole = rows.split()[:10] + ["TTTTTTTTaaaaTTTTTTTT"] * (1 + 3 * (seed % 2)) + rows.split()[:10]
    state, late, lit = start(" ".join(whole), fire), 0, 0
    for _ in range(8):
        turn, speed = torch.rand(2, generator=draws).tolist()
        wind = 12.0 * speed * torch.tensor([math.sin(6.3 * turn), math.cos(6.3 * turn)])
        state, now = in_wind(state, fire, wind[None, :, None, None]), float(fire.now(state))
        spreads, fuel = fire.spreads(state), fire.can_ignite(state)
        times = arrivals.sources(state, fire.now(state), spreads, fuel)
        coming = arrivals.next_arrivals(state, times, spreads, arrivals.beside(spreads, fuel, spreads), torch.zeros(1))
        if now > 0.0:
            assert coming.minutes.min() >= now - 1e-2 and (times[fuel] >= now).all()
        for _ in range(12):
            now, before = float(fire.now(state)), state
            state = steps(state, fire, 1)
            came = arrivals_in(state).minutes[(state.cells > 10) & (before.cells <= 10)]
            assert (came >= now - 0.5 - 1e-3).all() and (came <= now + 0.5 + 1e-3).all()
            late, lit = late + int((came < now - 1e-3).sum()), lit + len(came)
    assert lit > 100 and late <= 0.05 * lit


def test_rates_differ_as_much_as_they_are_told_to() -> None:
    key = world_key(torch.arange(400))
    pace = RateFire(cell_deviation=0.2, fire_deviation=0.4).pace(key, (40, 40))
    within, between = pace.log().std(dim=(1, 2)).mean().item(), pace.log().mean(dim=(1, 2)).std().item()
    assert within == pytest.approx(math.sqrt(math.log1p(0.04)), rel=0.02)
    assert between == pytest.approx(math.sqrt(math.log1p(0.16)), rel=0.15)  # of 400 fires: 4 standard errors
    assert pace.log().mean().item() == pytest.approx(0.0, abs=0.08)
    assert torch.equal(pace[7], RateFire(cell_deviation=0.2, fire_deviation=0.4).pace(key[7:8], (40, 40))[0])


def test_gains_are_factors_on_rates() -> None:
    ground, spell = forest(3), Spell(torch.tensor([3.0, 0.0]), 1.0)
    told = spread_in(law(), ground, 30.0, spell).head
    assert torch.allclose(spread_in(law(rate_gain=1.7), ground, 30.0, spell).head, told * 1.7)
    assert torch.allclose(spread_in(law(fuel_gain={C2: 0.5}), ground, 30.0, spell).head, told * 0.5)
    assert torch.equal(spread_in(law(fuel_gain={3: 0.5}), ground, 30.0, spell).head, told)
    stronger = spread_in(law(wind_gain=2.0), ground, 30.0, spell).head
    assert torch.allclose(stronger, spread_in(law(), ground, 30.0, Spell(torch.tensor([6.0, 0.0]), 1.0)).head)


def test_moisture_of_the_air_goes_before_that_of_the_fire() -> None:
    ground = forest(3)
    dry = torch.full((7,), math.nan)
    dry[5] = 96.0  # FFMC
    spells = [Spell(torch.zeros(2), 1.0, moisture) for moisture in (None, dry)]
    usual, drier = (spread_in(law(moisture={"bui": 80.0}), ground, 30.0, spell).head for spell in spells)
    both = spread_in(law(moisture={"bui": 80.0, "ffmc": 96.0}), ground, 30.0, spells[0]).head
    assert (drier > usual).all() and torch.equal(drier, both)


@pytest.mark.parametrize(
    ("options", "line"),
    [
        ({"model": "fbfm99"}, "model must be"),
        ({"moisture": {"dead": 3.0}}, "moisture must name some of dead_1h"),
        ({"moisture": {"dead_1h": 900.0}}, "moisture must be in"),
        ({"fuel_gain": {"grass": 2.0}}, "fuel_gain must map fuel codes"),
        ({"cell_deviation": -0.1}, "cell_deviation must be"),
        ({"minutes_per_tick": 0.0}, "minutes_per_tick must be"),
    ],
)
def test_values_out_of_range_are_refused(options: dict[str, object], line: str) -> None:
    with pytest.raises(ValueError, match=line):
        RateFire(**options)


def test_forecasts_tell_how_near_the_fire_is() -> None:
    fire = law(minutes_per_tick=1.0)
    state = steps(start("aTT", fire), fire, 1)
    probability = fire.ignition_probability(state)[0, 0]
    left = arrivals_in(state).minutes[0, 0, 1].item() - 1.0
    assert probability.tolist() == pytest.approx([0.0, 1.0 / left, 0.0], rel=1e-4)
    assert fire.expected_ignitions(state)[0, 0].tolist() == pytest.approx([1.0 / (left + 1.0), 0.0, 0.0], rel=1e-4)
    assert (arrivals_in(state).minutes < NEVER).sum() == 2
