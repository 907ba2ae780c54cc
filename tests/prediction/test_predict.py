"""Many fires on one map: hand-worked numbers on uniform ground, and what must hold for all."""

import math

import pytest
import torch

from warp_torchrl import fire_history
from warp_torchrl import predict as exported
from warp_torchrl.prediction.predict import lasting, predict
from warp_torchrl.world.air.weather import Weather
from warp_torchrl.world.fires import alone
from warp_torchrl.world.fires.members import Members
from warp_torchrl.world.fires.spell import Spell, spread_in
from warp_torchrl.world.law.passing import steepness
from warp_torchrl.world.law.rate import RateFire
from warp_torchrl.world.state.state import Landscape
from warp_torchrl.world.weather.table import WeatherTable

SIDE = 61
EVEN = RateFire(model="fbp", cell_deviation=0.0)
UNEVEN = RateFire(model="fbp", cell_deviation=0.3)


def ground(side=SIDE, code=31):
    shape = 1, side, side
    return Landscape(
        cover=torch.full(shape, 3, dtype=torch.uint8),
        age=torch.full(shape, 10, dtype=torch.uint8),
        elevation=None,
    ).with_layers(fuel=torch.full(shape, code, dtype=torch.int16))


def weather(*bearings, speed=3.0, ffmc=90.0):
    rows = len(bearings)
    return WeatherTable(
        wind_speed=torch.full((rows,), speed),
        wind_bearing=torch.tensor([float(each) for each in bearings]),
        ffmc=torch.full((rows,), ffmc),
        hours=torch.arange(float(rows)),
    )


def lit(row=SIDE // 2, column=SIDE // 2, side=SIDE):
    cells = torch.zeros(side, side, dtype=torch.bool)
    cells[row, column] = True
    return cells


def run(*bearings, fire=EVEN, fires=1, **options):
    return predict(ground(), weather(*bearings), lit(), fire=fire, fires=fires, cell_size=50.0, **options)


def head_of(bearing=270.0):
    _, wind, moisture, _ = next(Weather(table=weather(bearing)).spells(60.0))
    return spread_in(EVEN, ground(), 50.0, Spell(wind, 60.0, moisture))


def test_the_head_arrives_at_the_rate_of_the_model():
    found, middle = run(270.0), SIDE // 2
    rate = float(head_of().head[0, 0, 0])
    east = found.arrival_minutes[middle, middle + 1 : middle + 10]
    told = 50.0 / rate * torch.arange(1.0, 10.0)
    assert torch.allclose(east[told < 59.0], told[told < 59.0], rtol=1e-3, atol=2e-3)
    assert float(found.rate[middle, middle + 5]) == pytest.approx(rate, rel=1e-3)
    assert float(found.intensity[middle, middle + 5]) == pytest.approx(float(head_of().intensity[0, 0, 0]), rel=1e-3)
    assert float(found.head_rate[0]) == pytest.approx(rate, rel=1e-5)


def test_the_burned_area_is_that_of_the_ellipse():
    spread, found = head_of(), run(270.0)
    head, ratio = float(spread.head[0, 0, 0]), float(spread.length_to_breadth[0, 0, 0])
    focus = math.sqrt(1.0 - ratio**-2)
    long = head * 60.0 * (1.0 + (1.0 - focus) / (1.0 + focus))  # head and rear after an hour
    area = math.pi / 4.0 * long * long / ratio / 10_000.0
    assert float(found.area[0, 1]) == pytest.approx(area, rel=0.12)  # cells of 50 m
    assert float(found.progress[0, 1]) == pytest.approx(head * 60.0, abs=50.0)


def test_flanks_and_rear_go_slower_and_burn_less():
    found, middle = run(270.0, hours=1.5), SIDE // 2
    head, flank = (middle, middle + 8), (middle - 2, middle + 7)
    share = found.rate[flank] / found.rate[head]
    focus = float((1.0 - head_of().length_to_breadth[0, 0, 0] ** -2).sqrt())
    assert (1.0 - focus) / (1.0 + focus) < float(share) < 0.9
    assert float(found.intensity[flank] / found.intensity[head]) == pytest.approx(float(share), rel=1e-4)
    assert float(found.flame_length[flank] / found.flame_length[head]) == pytest.approx(float(share) ** 0.46, rel=1e-4)


def test_the_steepness_of_straight_fronts_is_right():
    row, column = torch.meshgrid(torch.arange(9.0), torch.arange(9.0), indexing="ij")
    for south, east in ((1.0, 0.0), (0.0, 1.0), (0.6, 0.8), (0.5**0.5, 0.5**0.5)):
        front = (south * row + east * column)[None] * 3.0 + 1.0
        assert torch.allclose(steepness(front)[0, 1:, 1:], torch.tensor(3.0), rtol=1e-5)


def test_a_fire_stops_at_its_area():
    found = run(270.0, 270.0, area=20.0)  # 80 cells of a quarter of a hectare
    whole = run(270.0, 270.0)
    assert float(found.final_area[0]) == pytest.approx(20.0, abs=0.5)
    assert float(found.followed[0]) < 120.0 == float(whole.followed[0])
    before = found.first_fire[~found.first_fire.isnan()]
    assert float(before.max()) == pytest.approx(float(found.followed[0]))
    assert torch.equal(before, whole.first_fire[~found.first_fire.isnan()])


def test_the_weather_begins_where_it_is_told():
    later = run(180.0, 270.0, start=60.0, hours=1.0)
    assert torch.equal(later.burn_probability, run(270.0).burn_probability)
    assert not torch.equal(later.burn_probability, run(180.0).burn_probability)


def test_bearings_are_turned_by_the_convergence():
    turned = run(280.0, convergence=10.0)
    assert torch.equal(turned.burn_probability, run(270.0).burn_probability)


def test_wind_at_20_feet_is_made_that_at_10_metres():
    low = WeatherTable(**{**vars(weather(270.0, speed=3.0 / 1.15)), "wind_height": "20ft"})
    found = predict(ground(), low, lit(), fire=EVEN, fires=1, cell_size=50.0)
    assert torch.allclose(found.first_fire, run(270.0).first_fire, rtol=1e-4, equal_nan=True)


def test_fires_repeat_by_their_seed_and_differ_without_it():
    one, again, other = (run(270.0, fire=UNEVEN, fires=6, seed=seed) for seed in (3, 3, 9))
    assert torch.equal(one.area, again.area) and torch.equal(one.rate.nan_to_num(), again.rate.nan_to_num())
    assert not torch.equal(one.area, other.area)
    part = run(270.0, fire=UNEVEN, fires=2, seed=5)
    assert torch.equal(one.area[2:4], part.area)


def test_how_many_burn_at_once_changes_nothing(monkeypatch):
    whole = run(270.0, fire=UNEVEN, fires=5)
    monkeypatch.setattr(alone, "AT_ONCE", 2)
    parts = run(270.0, fire=UNEVEN, fires=5)
    for name in ("burn_probability", "arrival_minutes", "half_minutes", "area", "progress"):
        assert torch.equal(getattr(whole, name).nan_to_num(), getattr(parts, name).nan_to_num()), name
    assert torch.allclose(whole.rate, parts.rate, equal_nan=True)


def test_quantiles_are_those_of_the_fires():
    found = run(270.0, fire=UNEVEN, fires=9)
    singles = torch.stack([run(270.0, fire=UNEVEN, fires=1, seed=seed).first_fire for seed in range(9)])
    came = ~singles.isnan()
    assert torch.allclose(found.burn_probability, came.float().mean(0))
    median, early = singles.nanquantile(0.5, dim=0), singles.nanquantile(0.1, dim=0)
    assert torch.allclose(found.arrival_minutes, median, atol=0.01, equal_nan=True)
    assert torch.allclose(found.arrival_early, early, atol=0.01, equal_nan=True)
    assert torch.equal(~found.half_minutes.isnan(), came.sum(0) >= 5)
    assert torch.equal(found.burned_by(1.0), came.sum(0) >= 5)


def test_fires_that_come_to_the_edge_are_told():
    near = predict(ground(), weather(270.0), lit(column=SIDE - 2), fire=EVEN, fires=1, cell_size=50.0)
    assert bool(near.left_map[0]) and not bool(run(270.0, hours=0.5).left_map[0])


def test_history_comes_in_minutes_as_the_prediction_does():
    cells = ground().age.clone()
    cells[0, SIDE // 2, SIDE // 2] = 11
    history = fire_history(
        cells, ground().cover, fire=EVEN, fuel=ground().layer("fuel"), weather=weather(270.0), ticks=24, cell_size=50.0
    )
    minutes = history.arrival_minutes[0]
    came = ~minutes.isnan()
    assert torch.equal(came, history.arrival[0] >= 0) and int(came.sum()) > 20
    assert torch.allclose(minutes[came], run(270.0).first_fire[came], rtol=2e-3, atol=1e-2)
    assert fire_history(cells, ground().cover, ticks=2).arrival_minutes is None


def test_the_function_is_the_package_s():
    assert exported is predict


def test_the_last_row_lasts_as_long_as_the_one_before():
    assert lasting(weather(1, 2, 3), 0.0) == 180.0 and lasting(weather(1), 15.0) == 45.0


REFUSED = {
    "fires must be in 1..1000000, got 0": {"fires": 0},
    "area must be over 0": {"area": 0.0},
    "hours must be over 0": {"hours": 0.0},
    "seed must be in 0": {"seed": -1},
    "seed must be in 0..2": {"seed": 2**63},
    "hours must be over 0 and at most 1e5, got nan": {"hours": math.nan},
    "area must be over 0 and under 1e9 ha, got nan": {"area": math.nan},
    "start must be within 1e.08 minutes of the weather's first row, got nan": {"start": math.nan, "hours": 1.0},
    "convergence must be in": {"convergence": math.nan},
    "start must be before the weather's end, 60 minutes": {"start": 60.0},
    "start must be before the weather's end, 60 minutes after its first row, got 61": {"start": 61.0, "hours": 1.0},
    "start must not be before the weather's first row, got 5 minutes before it": {"start": -5.0, "hours": 1.0},
}


@pytest.mark.parametrize("rule", REFUSED)
def test_a_mistake_is_told_in_one_line(rule):
    with pytest.raises(ValueError, match=rule) as told:
        run(270.0, **REFUSED[rule])
    assert "\n" not in str(told.value)


def test_an_ignition_without_fuel_is_refused():
    with pytest.raises(ValueError, match="ignition must light a cell with fuel, none of its 1"):
        predict(ground(code=102), weather(270.0), lit(), fire=EVEN, cell_size=50.0)
    with pytest.raises(ValueError, match=r"ignition must be bool \[61, 61\]"):
        predict(ground(), weather(270.0), lit(side=SIDE + 1), fire=EVEN)


HISTORIES = {
    "fuel must be left out under laws": {"fuel": ground(8).layer("fuel")},
    "wind must be left out where weather": {"wind": (1.0, 0.0), "weather": weather(1), "fire": EVEN},
    "first_tick must be 0 under law rate": {"fire": EVEN, "first_tick": 2},
    r"fuel must hold whole codes \[1, 8, 8\]": {"fire": EVEN, "fuel": ground(9).layer("fuel")},
    "minutes_per_tick must be given": {"weather": weather(1, 2)},
}


@pytest.mark.parametrize("rule", HISTORIES)
def test_a_history_refuses_what_its_law_cannot_do(rule):
    with pytest.raises(ValueError, match=rule):
        fire_history(ground(8).age, ground(8).cover, **HISTORIES[rule])


def test_members_burn_each_in_its_wind_and_at_its_rates():
    values = torch.tensor([[0.0, 0.0, 0.0, 0.0], [math.log(1.3), math.log(2.0), 20.0, 0.0]])
    both = run(270.0, fires=2, members=Members(values), hours=0.5)
    one, other = (run(270.0, members=Members(values[at : at + 1]), hours=0.5) for at in (0, 1))
    came = (both.burn_probability == 1.0) & (both.arrival_minutes > 5.0)
    for name in ("rate", "intensity"):
        mean = (getattr(one, name) + getattr(other, name)) / 2.0
        assert torch.allclose(getattr(both, name)[came], mean[came], rtol=0.03)
    assert bool(came.any()) and float(other.final_area[0]) > 1.3 * float(one.final_area[0])
    with pytest.raises(ValueError, match="members must be as many as fires, 3, got 2"):
        run(270.0, fires=3, members=Members(values))
