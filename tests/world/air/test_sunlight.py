"""Dead fuel moisture by aspect, slope and shade on a map."""

from dataclasses import replace

import pytest
import torch

from warp_torchrl.world.air.fields import Lattice, WeatherFields
from warp_torchrl.world.air.sunlight import by_sunlight
from warp_torchrl.world.behaviour.moistures import MOISTURES
from warp_torchrl.world.weather.table import WeatherTable, read_weather

ROWS = """datetime,temperature [C],RH,rain [mm],wind_speed [m/s],wind_direction,gust [m/s],cloud
2024-08-01 14:00,29.4,22,0,3,0,6,10
2024-08-01 15:00,29.4,22,0,3,0,6,80
2024-08-01 16:00,29.4,22,1,3,0,6,10
"""


@pytest.fixture
def table(tmp_path) -> WeatherTable:
    (tmp_path / "weather.csv").write_text(ROWS)
    return read_weather(tmp_path / "weather.csv", asked=("cloud",))


def fine(sunlight, east, north, cover=None):
    """Return the moisture of fine fuel where the ground rises so [%]."""
    rise = torch.tensor([east, north], dtype=torch.float32)[None, :, None, None]
    factors = sunlight.factors(rise, None if cover is None else torch.full((1, 1, 1), cover))
    assert factors.shape == (1, 1, 1, len(MOISTURES)) and (factors[..., 3:] == 1.0).all()
    return float(factors[..., 0] * sunlight.level)


def test_a_slope_has_the_moisture_of_its_aspect_and_level_ground_the_mean_of_all(table):
    weather, _, sunlight = by_sunlight(table)
    first = sunlight[0]
    # 85 F, 22 %: reference 3. August, 14 o'clock: steep 3, 2, 1 and 1 to the north, east, south and west; gentle 1.
    assert [fine(first, *rise) for rise in ((0, -0.5), (-0.5, 0), (0, 0.5), (0.5, 0))] == pytest.approx([6, 5, 4, 4])
    assert fine(first, 0.0, -0.2) == pytest.approx(4.0)
    assert fine(first, 0.0, 0.0) == pytest.approx(4.0) and float(weather.dead_1h[0]) == 4.0
    assert (float(weather.dead_10h[0]), float(weather.dead_100h[0])) == (5.0, 6.0)
    assert fine(first, 0.0, 0.5, cover=50.0) == pytest.approx(7.0) and fine(first, 0.0, 0.5, cover=49.0) == 4.0


def test_clouds_shade_all_ground_and_rain_wets_it(table):
    _, overcast, wet = by_sunlight(table).sunlight
    assert fine(overcast, 0.0, 0.5) == pytest.approx(7.0)  # 3 + 4, as under crowns
    assert fine(wet, 0.0, 0.5) == fine(wet, 0.0, -0.5) == 35.0


def test_the_sun_of_rows_in_utc_is_that_of_the_longitude_and_in_the_south_it_stands_in_the_north(table):
    utc = replace(table, zone=0.0)
    # 14:00 in UTC is 20:00 at 90 degrees east, and night: shaded fuel's 5 at 18 o'clock.
    assert float(by_sunlight(utc, longitude=90.0).table.dead_1h[0]) == 8.0
    south = by_sunlight(table, in_south=True).sunlight[0]  # August there is as February, of the same table
    assert [fine(south, *rise) for rise in ((0, -0.5), (0, 0.5))] == pytest.approx([4.0, 6.0])


def test_weather_without_a_date_or_humidity_is_refused(table):
    with pytest.raises(ValueError, match="moisture=fosberg needs dates"):
        by_sunlight(replace(table, began=None))
    with pytest.raises(ValueError, match="needs temperature and humidity"):
        by_sunlight(replace(table, humidity=None))


def by_place(air=None, dead=float("nan")):
    """Return three hours of weather at two points in a row, of this dead moisture."""
    moisture = torch.full((3, len(MOISTURES), 2, 2), float("nan"))
    moisture[:, :3] = dead
    return WeatherFields(Lattice((0.0, 8.0), (0.0, 8.0)), torch.ones(3, 2, 2, 2), moisture, air)


def test_level_ground_has_the_moisture_of_the_air_above_it(table):
    # 85 F: reference 3 at 22 %, 7 at 52 %; on level ground 1 more at 14 o'clock, 2 at 16, 4 under clouds.
    air = torch.tensor([[29.4, 22.0, 0.0], [29.4, 52.0, 0.0]]).T[None, :, None].expand(3, 3, 2, 2).clone()
    air[2, 2, :, 1] = 1.0
    weather, fields, sunlight = by_sunlight(table, by_place(air))
    assert fields.moisture[:, 0, 0].tolist() == [[4.0, 8.0], [7.0, 11.0], [5.0, 35.0]]
    assert fields.moisture[0, 2, 0].tolist() == [6.0, 10.0] and bool(fields.moisture[:, 3:].isnan().all())
    assert weather.dead_1h.tolist() == [6.0, 9.0, 20.0] and sunlight[2].dry[0].tolist() == [1.0, 0.0]


def test_dead_fuel_that_rasters_give_by_place_is_not_computed_again(table):
    assert by_sunlight(table, by_place()).table.dead_1h[0] == 4.0
    with pytest.raises(ValueError, match="which rasters of the weather give by place"):
        by_sunlight(table, by_place(dead=5.0))
