"""Files of fire weather stations that are no CSV."""

import pytest

from warp_torchrl.system.provenance import gathered
from warp_torchrl.world.weather.table import read_weather

STREAM = """
RAWS_ELEVATION: 4200
RAWS_WINDS: Ave
RAWS_UNITS: English

Year  Mth  Day   Time    Temp     RH    HrlyPcp   WindSpd  WindDir CloudCov
2024   12   31   2300    86       25      0.00      10       270      10
2025    1    1      0    77       20      0.10      20       300      10
"""
# Columns 1..63: type, station, date, time, kind, state, temperature, humidity, bearing, speed, and the codes last
WIMS = "W13045723{date}{time}{kind}0 86 25{bearing}{speed}{rest}{moisture}{measure}"


def wims(time, kind="R", bearing="270", speed=" 10", moisture="2", measure="1", date="20240701"):
    rest = " " * 26
    return WIMS.format(**locals())


@pytest.fixture
def read(tmp_path):
    def read(text, name="a.wxs", **options):
        (tmp_path / name).write_text(text.lstrip("\n"))
        with gathered() as files:
            return read_weather(tmp_path / name, **options), files[0]

    return read


def test_an_english_stream_is_in_miles_at_20_feet_fahrenheit_and_inches(read):
    weather, files = read(STREAM)
    assert weather.hours.tolist() == [0, 1] and weather.wind_height == "20ft"
    assert weather.wind_speed.tolist() == pytest.approx([4.4704, 8.9408])
    assert weather.temperature.tolist() == pytest.approx([30, 25], abs=1e-4)
    assert weather.rain.tolist() == pytest.approx([0, 2.54])
    assert files.read["WindSpd"] == "wind_speed, mph" and "CloudCov" in files.left
    assert "RAWS_ELEVATION: 4200" in files.left


def test_a_metric_stream_is_in_kilometres_at_10_metres(read):
    weather, _ = read(STREAM.replace("English", "METRIC").replace("86 ", "31 ").replace("77 ", "30 "))
    assert weather.wind_speed.tolist() == pytest.approx([10 / 3.6, 20 / 3.6]) and weather.wind_height == "10m"
    assert weather.temperature.tolist() == [31, 30] and weather.rain.tolist() == pytest.approx([0, 0.1])


def test_a_stream_may_leave_out_its_names_and_count_its_rows(read):
    lines = [line for line in STREAM.strip().splitlines() if line and not line.startswith("Year")]
    assert read("\n".join(["RAWS: 2", *lines]))[0].hours.tolist() == [0, 1]
    with pytest.raises(ValueError, match="RAWS must count the rows, it says 3 and there are 2"):
        read("\n".join(["RAWS: 3", *lines]))
    with pytest.raises(ValueError, match="RAWS_UNITS must be English or Metric, got none"):
        read("\n".join(line for line in lines if "UNITS" not in line))
    with pytest.raises(ValueError, match="rows must have 10 cells as the header, got 9 in row 2"):
        read("\n".join(lines)[:-3])


def test_english_rain_in_whole_numbers_is_asked_for(read):
    text = STREAM.replace("0.00", "0").replace("0.10", "10")
    with pytest.raises(ValueError, match=r"HrlyPcp must name its unit .* got in or in/100"):
        read(text)
    assert read(text, units={"rain": "in/100"})[0].rain.tolist() == pytest.approx([0, 2.54])
    assert read(STREAM.replace("0.10", "0").replace("0.00", "0"))[0].rain.tolist() == [0, 0]


def test_a_wind_file_has_no_year_and_goes_over_its_end(read):
    weather, _ = read("ENGLISH\n12 31 2300 10 270 0\n1 1 0 20 300 0\n", "a.wnd")
    assert weather.hours.tolist() == [0, 1] and weather.wind_height == "20ft"
    assert weather.wind_speed.tolist() == pytest.approx([4.4704, 8.9408]) and weather.temperature is None
    metric, _ = read("METRIC\n8 10 0 36 270\n8 10 30 36 270\n", "a.wnd")
    assert metric.hours.tolist() == [0, 0.5] and metric.wind_speed.tolist() == [10, 10]
    with pytest.raises(ValueError, match=r"daily weather \(.wtr\) has none"):
        read("ENGLISH\n8 10 00 600 1500 48 99 94 11 2400\n", "a.wtr")


def test_fixed_columns_of_wims_are_read(read):
    rows = [wims("1200"), wims("1300", bearing="  0", speed="  0"), wims("1300", "O", speed=" 20"), wims("1400", "F")]
    weather, files = read("\n".join(rows), "a.fw13")
    assert weather.hours.tolist() == [0, 1] and weather.wind_height == "20ft"  # the published one, no forecast
    assert weather.wind_speed.tolist() == pytest.approx([4.4704, 8.9408])
    assert weather.temperature.tolist() == pytest.approx([30, 30]) and weather.humidity.tolist() == [25, 25]
    assert weather.rain is None and "rain, which is that of 24 hours" in files.left
    metric = "\n".join(wims(time, measure="2").replace("86", "30") for time in ("1200", "1300"))
    weather, _ = read(metric, "a.fw9")
    assert weather.wind_speed.tolist() == pytest.approx([10 / 3.6] * 2) and weather.wind_height == "20ft"


def test_a_bearing_of_0_is_no_direction_in_wims(read):
    assert read(wims("1200", bearing="  0", speed="  0"))[0].wind_bearing.tolist() == [0]
    with pytest.raises(ValueError, match=r"WindDir must tell where wind of 4.4704 m/s comes from, got '0' in row 1"):
        read(wims("1200", bearing="  0"))


def test_a_dew_point_of_wims_becomes_humidity(read):
    # 86 F and a dew point of 25 F: 100 e(-3.89) / e(30.0) hPa = 100 * 4.59 / 42.4
    assert read(wims("1200", moisture="3"))[0].humidity.tolist() == pytest.approx([10.8], abs=0.1)
    assert read(wims("1200", moisture="1"))[0].humidity is None  # a wet bulb


@pytest.mark.parametrize(
    ("rows", "words"),
    [
        ([wims("1200"), wims("1300", measure="2")], "weather must be of one station and in one system of units"),
        ([wims("1200"), wims("1300").replace("045723", "045724")], "weather must be of one station"),
        ([wims("1200"), wims("1300")[:40]], "weather must be of one station"),
        ([wims("1200", measure=" ")], "codes of moisture and of units must be 1..3 and 1 or 2, got '2' and ' '"),
    ],
)
def test_observations_that_are_not_alike_are_refused(read, rows, words):
    with pytest.raises(ValueError) as refusal:
        read("\n".join(rows), "a.fw13")
    assert words in str(refusal.value)
