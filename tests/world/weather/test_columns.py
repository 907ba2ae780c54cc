"""Names and units of columns: what a file states, what its source says, and what is asked for."""

import pytest

from warp_torchrl.world.weather.columns import find_columns, read_column_header
from warp_torchrl.world.weather.quantities import QUANTITIES


@pytest.mark.parametrize(
    ("header", "quantity", "unit", "height"),
    [
        ("wind_speed (km/h)", "wind_speed", "km/h", None),
        ("windspeed_10m [m/s]", "wind_speed", "m/s", "10m"),
        ("Wind Speed (10 m) [m/s]", "wind_speed", "m/s", "10m"),
        ("windspeedKmph", "wind_speed", "km/h", None),
        ("WS_ms_Avg", "wind_speed", "m/s", None),
        ("sknt", "wind_speed", "kt", None),
        ("Wind (mph)", "wind_speed", "mph", None),
        ("Temp (°C)", "temperature", "c", None),
        ("Temp - °F", "temperature", "f", None),
        ("Temp, °C (LGR S/N: 1)", "temperature", "c", None),
        ("tmpf", "temperature", "f", None),
        ("temperature_2m (ºC)", "temperature", "c", "2m"),
        ("Air Temperature in degrees C", "temperature", "c", None),
        ("TEMPERATURA DO AR - BULBO SECO, HORARIA (°C)", "temperature", "c", None),
        ("Rel Hum (%)", "humidity", "%", None),
        ("Humedad relativa (%)", "humidity", "%", None),
        ("Precip. Amount (mm)", "rain", "mm", None),
        ("precip_accum_one_hour_set_1", "rain", None, None),
        ("Wind Dir (10s deg)", "wind_bearing", "10deg", None),
        ("VENTO, DIREÇÃO HORARIA (gr) (° (gr))", "wind_bearing", "deg", None),
        ("WD (rad)", "wind_bearing", "rad", None),  # no unit that is read, and so refused
        ("wind_dir[80]", "wind_bearing", None, None),
        ("RH (avg)", "humidity", None, None),
        ("HFFMC", "ffmc", None, None),
        ("wind_gusts_10m (km/h)", "wind_gust", "km/h", "10m"),
        ("cloud_cover (%)", "cloud", "%", None),
        ("DuffMoistureCode", "dmc", None, None),
        *((name, None, None, None) for name in ("wind", "wind_to_direction", "Temp Flag")),
        *((name, None, None, None) for name in ("temperature_2m_max (°C)", "rain_trace", "ISI", "soil_temperature")),
    ],
)
def test_a_header_is_a_quantity_a_unit_and_a_height(header, quantity, unit, height):
    found = read_column_header(header)
    assert (found.quantity, found.unit if quantity else None, found.height) == (quantity, unit, height)


def test_wind_of_other_heights_and_air_above_two_metres_are_not_read():
    for name in ("wind_speed_100m (km/h)", "wind_speed_2m (km/h)", "temperature_80m (°C)"):
        assert read_column_header(name).quantity is None
    with pytest.raises(ValueError, match=r"wind_speed_80m \(m/s\) is not the wind at 10 m or 20 ft"):
        find_columns(["wind_speed_80m (m/s)", "WD"])


def test_every_name_is_one_quantity_and_reads_as_its_own():
    names = [name for quantity in QUANTITIES.values() for tier in quantity.names for name in tier]
    assert len(names) == len(set(names))
    for quantity, kind in QUANTITIES.items():
        for tier in kind.names:
            assert {read_column_header(name).quantity for name in tier - {"wind"}} == {quantity}


RAWS = ["Year", "Mth", "Day", "Time", "Temp", "RH", "Precip", "WindSpd", "WindDir"]


def unit(headers, rows=(), name="wind_speed", **options):
    return find_columns(headers, rows, **options)[0][name].unit


def test_without_a_unit_names_that_are_of_one_source_alone_say_it():
    assert unit(["WS", "WD"]) == "km/h" and unit(["ws", "wd", "temp"], name="temperature") == "c"
    hot = [["2024", "7", "1", "1200", "86", "25", "0.1", "10", "270"]]
    assert unit(RAWS, hot) == "mph" and unit(RAWS, hot, "temperature") == "f" and unit(RAWS, hot, "rain") == "in"
    burn_p3 = ["Temperature", "RelativeHumidity", "WindSpeed", "WindDirection", "FineFuelMoistureCode"]
    assert unit(burn_p3) == "km/h" and unit(burn_p3, name="temperature") == "c"


@pytest.mark.parametrize(
    ("headers", "temperature"),
    [
        (RAWS, "31"),  # a summer in Celsius, and frost in Fahrenheit
        ([*RAWS, "FFMC"], "86"),  # a code that RAWS does not have
        (["WindSpeed", "WindDirection", "Temp"], "86"),
        (["WindSpd", "WD", "RH"], "20"),
        (["Velocidad del viento", "WD", "RH"], "20"),
    ],
)
def test_what_nobody_states_is_asked_for(headers, temperature):
    row = [temperature] * len(headers)
    with pytest.raises(ValueError) as refusal:
        find_columns(headers, [row])
    wind = next(header for header in headers if read_column_header(header).quantity == "wind_speed")
    assert str(refusal.value) == (
        f"{wind} must name its unit (m/s, km/h, mph, kt), as in wind_speed [m/s], got none: write it there, or say "
        "which by the key units.wind_speed"
    )


def test_the_user_says_a_unit_by_quantity_or_by_column():
    headers = ["WindSpeed", "WD"]
    for key in ("wind_speed", "WindSpeed", "windspeed"):
        assert unit(headers, given_units={key: "km/h"}) == "km/h"
    assert unit(["WS", "WD"], given_units={"WS": "m/s"}) == "m/s"  # before what is only the custom
    assert unit(["WS (furlong)", "WD"], given_units={"WS": "mph"}) == "mph"  # and before what is no unit


@pytest.mark.parametrize(
    ("told", "words"),
    [
        ({"wind_speed": "furlong"}, "units.wind_speed must be m/s, km/h, mph, kt, got furlong"),
        ({"wind_sped": "m/s"}, "units must name a quantity (wind_speed, wind_bearing, temperature,"),
        ({"wind_speed": "m/s"}, "WindSpeed (km/h) must have one unit, it says km/h and units.wind_speed=m/s"),
    ],
)
def test_what_the_user_says_is_checked(told, words):
    with pytest.raises(ValueError) as refusal:
        find_columns(["WindSpeed (km/h)", "WD"], given_units=told)
    assert str(refusal.value).startswith(words)


def test_a_row_of_units_below_the_names_is_honoured():
    headers, below = ["windspeed", "wd", "temp"], ["km/h", "deg", "C"]
    assert unit(headers, below=below) == "km/h" and unit(headers, below=below, name="temperature") == "c"
    with pytest.raises(ValueError, match=r"must have one unit, it says m/s and km/h in the row below it"):
        find_columns(["windspeed (m/s)", "wd", "temp"], below=below)
    with pytest.raises(ValueError, match="got furlong"):
        find_columns(headers, below=["furlong", "deg", "C"])


def test_of_two_columns_the_better_one_is_read_and_two_alike_are_refused():
    found, _ = find_columns(["ws", "wd", "rain (mm)", "precipitation (mm)", "FFMC", "HFFMC"])
    assert found["rain"].header == "precipitation (mm)" and found["ffmc"].header == "HFFMC"
    assert find_columns(["wind_spd_kmh", "wind_spd_kt", "wd"])[0]["wind_speed"].header == "wind_spd_kmh"
    with pytest.raises(ValueError, match="weather must have one column of rain, got rain, chuva"):
        find_columns(["ws", "wd", "rain", "chuva"])
