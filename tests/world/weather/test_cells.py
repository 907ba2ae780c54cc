"""Cells of weather: calm winds without a direction, missing values, points of the compass."""

import pytest

from warp_torchrl.world.weather.table import read_weather


@pytest.fixture
def table(tmp_path):
    def write(text, **options):
        (tmp_path / "weather.csv").write_text(text, encoding="utf-8")
        return read_weather(tmp_path / "weather.csv", **options)

    return write


@pytest.mark.parametrize("cell", ["", "NaN", "0", "990", "999", "VRB", "M", "-9999", "calm", "Calma", "---"])
def test_a_calm_needs_no_direction(table, cell):
    weather = table(f"WS,WD\n0.0,{cell}\n36,300\n")
    assert weather.wind_speed.tolist() == [0, 10] and weather.wind_bearing.tolist() == [0, 300]


def test_a_calm_may_have_a_direction(table):
    assert table("WS,WD\n0,120\n0,NE\n").wind_bearing.tolist() == [120, 0]


@pytest.mark.parametrize("cell", ["", "NaN", "990", "999", "VRB", "M", "-9999"])
def test_wind_without_a_direction_is_refused_with_its_row(table, cell):
    with pytest.raises(ValueError, match=rf"WD must tell where wind of 10 m/s comes from, got '{cell}' in row 2"):
        table(f"WS,WD\n0,\n36,{cell}\n")


def test_a_direction_may_be_a_point_of_the_compass(table):
    weather = table("WS;WD\n36;NNW\n36;sw\n36;Noroeste\n36;South-East\n")
    assert weather.wind_bearing.tolist() == [337.5, 225, 315, 135]
    with pytest.raises(ValueError, match="WD must be a number, got 'O' in row 1"):  # west, or east
        table("WS,WD\n36,O\n")


@pytest.mark.parametrize("cell", ["M", "NA", "", "-9999", "-999", "null", "9999", "n/d"])
def test_a_missing_value_is_refused_with_its_row(table, cell):
    with pytest.raises(ValueError, match=rf"TMP must be a number, got '{cell}' in row 2, which is missing"):
        table(f"WS,WD,TMP\n5,0,20\n5,0,{cell}\n")


def test_a_column_without_any_value_is_not_there(table):
    assert table("WS,WD,TMP,APCP\n5,0,M,-9999\n5,0,NA,-9999\n").temperature is None
    with pytest.raises(ValueError, match="WS must be a number, got 'NA' in row 1, which is missing"):
        table("WS,WD\nNA,0\n")


def test_a_drought_code_of_999_is_a_number(table):
    assert table("WS,WD,DC\n5,0,999\n").dc.tolist() == [999]


def test_a_trace_of_rain_is_none(table):
    assert table("WS,WD,APCP\n5,0,T\n5,0,0.2\n").rain.tolist() == pytest.approx([0, 0.2])


def test_humidity_as_a_share_is_asked_for(table):
    text = "WS,WD,TMP,RH\n5,0,20,0.25\n5,0,20,1\n"
    with pytest.raises(ValueError, match=r"RH must be in per cent, or say units.humidity=fraction, got 1 at most"):
        table(text)
    assert table(text, units={"RH": "fraction"}).humidity.tolist() == [25, 100]
