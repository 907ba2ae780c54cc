"""Tables of weather: the shared ones, those of Canada and of RAWS, and every refusal in one line."""

import logging
from dataclasses import fields
from pathlib import Path

import pytest
import torch

from warp_torchrl.world.weather.fwi import buildup_index, hourly_ffmc
from warp_torchrl.world.weather.table import WeatherValues, read_weather

FIRES = Path(__file__).parents[4] / "shared" / "fires"
needs_fires = pytest.mark.skipif(not FIRES.is_dir(), reason="the shared fires are not here")


def warnings(caplog):
    return [each.message for each in caplog.records if each.levelno >= logging.WARNING]


@pytest.fixture
def table(tmp_path):
    def write(text, **options):
        path = tmp_path / "weather.csv"
        path.write_text("\n".join(line.strip() for line in text.strip().splitlines()), encoding="utf-8")
        return read_weather(path, **options)

    return write


@needs_fires
@pytest.mark.parametrize("fire", ["arrowhead", "glacier", "mica"])
def test_the_canadian_files_of_the_shared_fires_are_read(fire, caplog):
    weather = read_weather(FIRES / fire / "weather.csv")
    assert weather.hours.tolist() == list(range(len(weather.hours))) and not warnings(caplog)
    assert weather.wind_speed[0].item() == pytest.approx(2 / 3.6) and weather.wind_height == "10m"
    assert (weather.ffmc[0], weather.dmc[0], weather.dc[0]) == (77, 25, 200)
    assert weather.bui[0].item() == pytest.approx(38.1)
    assert weather.dead_1h is not None and weather.live_woody is None


@needs_fires
def test_rows_of_one_time_are_an_hour_apart_and_the_log_says_so(caplog):
    with caplog.at_level(logging.WARNING, logger="warp_torchrl"):
        weather = read_weather(FIRES / "clinge" / "weather.csv")
    assert weather.hours.tolist() == list(range(len(weather.hours)))
    assert weather.wind_speed[0].item() == pytest.approx(11.61 / 3.6) and weather.ffmc is None
    (line,) = caplog.messages
    assert line == "weather: every row has the same time; its rows are taken to be an hour apart"


def test_raws_files_are_in_miles_fahrenheit_and_inches(table):
    weather = table(
        """
        Year,Mth,Day,Time,Temp,RH,Precip,WindSpeed,WindDirection
        2023,7,4,1200,77,20,0.1,10,180
        2023,7,4,1300,86,15,0,20,200"""
    )
    assert weather.wind_speed.tolist() == pytest.approx([4.4704, 8.9408]) and weather.wind_height == "20ft"
    assert weather.temperature.tolist() == pytest.approx([25, 30], abs=1e-5)
    assert weather.rain.tolist() == pytest.approx([2.54, 0]) and weather.hours.tolist() == [0, 1]


def test_a_dew_point_is_at_most_the_temperature(table):
    text = "time,temp [C],dewpoint [{}],ws [m/s],wd\n2024-07-01 12:00,20,21,4,90\n2024-07-01 13:00,20,50,4,90"
    assert table(text.format("F")).humidity.tolist() == pytest.approx([16.6, 52.5], abs=0.1)  # -6.1 and 10 C
    with pytest.raises(ValueError, match="dew_point must be at most the temperature, got 50 and 20 C in row 2"):
        table(text.format("C"))  # a degree above it is rounded


def test_our_own_names_say_their_units(table):
    weather = table(
        """
        hours;wind_speed_ms;wind_bearing;temperature_c;humidity;rain_mm;dead_1h;live_woody
        0;5;0;20;30;0;6;100
        0.5;6;360;21;30;0;7;100
        3;7;90;22;30;0;8;90"""
    )
    assert weather.hours.tolist() == [0, 0.5, 3] and weather.wind_speed.tolist() == [5, 6, 7]
    assert weather.dead_1h.tolist() == [6, 7, 8] and weather.live_woody.tolist() == [100, 100, 90]
    assert weather.dead_10h is not None  # from the air


@pytest.mark.parametrize(
    ("header", "number", "told"),
    [
        ("WS", 36, 10),
        ("WindSpeed (km/h)", 36, 10),
        ("Wind Speed [m/s]", 10, 10),
        ("windspeed_kmh", 36, 10),
        ("wind_speed_mph", 10, 4.4704),
        ("wind_speed [knots]", 10, 5.14444),
        ("ws_ms", 10, 10),
    ],
)
def test_a_unit_stands_in_brackets_or_behind_the_name(table, header, number, told):
    weather = table(f"{header},WD\n{number},0")
    assert weather.wind_speed.item() == pytest.approx(told)
    assert weather.wind_height == ("20ft" if "mph" in header else "10m")


def test_the_height_of_the_wind_can_be_told(table):
    assert table("WS (mph),WD\n5,0").wind_height == "20ft"  # miles an hour are not the Canadian custom
    assert table("windspeed_10m (mp/h),WD\n5,0").wind_height == "10m"
    assert table("windspeed_20ft (km/h),WD\n5,0").wind_height == "20ft"
    assert table("WS,WD\n5,0", wind_height="20ft").wind_height == "20ft"
    assert table("WindSpeed_mph,WindDirection\n5,0", wind_height="10m").wind_height == "10m"


@pytest.mark.parametrize(
    ("first", "second", "hours"),
    [
        ("2018-08-10 23:00", "2018-08-11 01:00", 2),
        ("2018-08-10T23:00:00Z", "2018-08-11T00:30:00Z", 1.5),
        ("10-08-2018 23:00", "11-08-2018 0:00", 1),  # not a month
        ("08/10/2018 23:00", "08/11/2018 0:00", 1),
        ("31/08/18 23:00", "01/09/18 0:00", 1),
        ("20180810 2300", "20180811 0000", 1),
        ("10.08.2018 5", "10.08.2018 6", 1),
    ],
)
def test_dates_are_read_in_the_form_that_makes_the_shortest_time(table, first, second, hours):
    assert table(f"datetime,WS,WD\n{first},5,0\n{second},5,0").hours.tolist() == [0, hours]


def test_date_and_hour_may_be_two_columns(table):
    assert table("date,hour,WS,WD\n2018-08-10,9,5,0\n2018-08-10,13,5,0").hours.tolist() == [0, 4]
    assert table("date,time,WS,WD\n2018-08-10,900,5,0\n2018-08-10,1330,5,0").hours.tolist() == [0, 4.5]


def test_a_table_without_times_has_a_row_an_hour(table, caplog):
    assert table("WS,WD\n5,0\n5,0\n5,0").hours.tolist() == [0, 1, 2]
    assert warnings(caplog) == ["weather: no column tells the time; its rows are taken to be an hour apart"]


def test_a_row_holds_until_the_next_and_the_last_holds_on(table):
    weather = table("hours,WS,WD,FFMC\n0,3.6,0,80\n1,7.2,90,85\n3,10.8,180,90")
    minutes = torch.tensor([[-5.0, 0.0, 59.9], [60.0, 179.0, 1e6]])
    at = weather.at(minutes)
    assert type(at) is WeatherValues and at.temperature is None and at.wind_height == "10m"
    assert torch.allclose(at.wind_speed, torch.tensor([[1.0, 1, 1], [2, 2, 3]]))
    assert at.ffmc.tolist() == [[80, 80, 80], [85, 85, 90]]
    assert weather.at(100).wind_bearing.item() == 90
    values = [getattr(at, each.name) for each in fields(WeatherValues)]
    assert {(each.dtype, each.shape) for each in values if isinstance(each, torch.Tensor)} == {(torch.float32, (2, 3))}


def test_ffmc_is_computed_by_the_hour_where_it_is_not_given(table):
    text = "hours,WS,WD,TMP,RH,APCP\n0,10,0,20,40,0\n1,10,0,25,30,0\n3,20,0,20,90,2"
    air = [torch.tensor(values) for values in ([20.0, 25, 20], [40.0, 30, 90], [10 / 3.6, 10 / 3.6, 20 / 3.6])]
    code, told = torch.tensor(70.0), []
    for row, (rain, lasted) in enumerate([(0.0, 1.0), (0.0, 1.0), (2.0, 2.0)]):
        code = hourly_ffmc(code, *(each[row] for each in air), torch.tensor(rain), lasted)
        told.append(code.item())
    assert table(text, start_ffmc=70.0).ffmc.tolist() == pytest.approx(told)
    lower = table(text, start_ffmc=70.0, wind_height="20ft")  # a wind at 20 ft is stronger at 10 m
    assert lower.ffmc[0] > told[0] and table("WS,WD,TMP,RH\n5,0,20,40").ffmc is None


def test_bui_comes_from_the_file_from_dmc_and_dc_or_from_the_user(table):
    assert table("WS,WD,DMC,DC,BUI\n5,0,25,200,40", bui=9).bui.item() == 40
    both = table("WS,WD,DMC,DC\n5,0,25,200", bui=9).bui
    assert both.item() == buildup_index(torch.tensor(25.0), torch.tensor(200.0)).item()
    assert table("WS,WD,DMC\n5,0,25", bui=9).bui.item() == 9 and table("WS,WD\n5,0").bui is None


def test_empty_columns_are_not_there(table):
    weather = table("WS,WD,FFMC,TMP\n5,0,,20\n5,0,,21")
    assert weather.ffmc is None and weather.temperature.tolist() == [20, 21]


@pytest.mark.parametrize(
    ("text", "words"),
    [
        ("WD,TMP\n0,5", "weather must have a column of wind_speed (ws, windspeed, windspd, wind_speed), got WD, TMP"),
        ("WS,TMP\n0,5", "weather must have a column of wind_bearing (wd, winddirection, winddir, wind_direction, "),
        ("WS,WindSpeed,WD\n1,1,5", "weather must have one column of wind_speed, got WS, WindSpeed"),
        ("wind_speed,WD\n1,5", "wind_speed must name its unit (m/s, km/h, mph, kt), as in wind_speed [m/s], got none"),
        ("WS (furlong),WD\n1,5", "WS (furlong) must name its unit (m/s, km/h, mph, kt), as in wind_speed [m/s], got f"),
        ("wind_speed_ms,WD,temp\n1,5,3", "temp must name its unit (c, f, k), as in temperature [c], got none"),
        ("WS,WD\n1,5\nx,5", "WS must be a number, got 'x' in row 2"),
        ("WS,WD\n1,5\n,5", "WS must be a number, got '' in row 2"),
        ("WS,WD\n1,nan", "WD must tell where wind of 0.277778 m/s comes from, got 'nan' in row 1"),
        ("WS,WD\n1,5\n1,361", "WD must be in [0, 360] deg, got 361 in row 2"),
        ("WS,WD\n720,5", "WS must be in [0, 100] m/s, got 200 in row 1"),
        ("WS,WD,TMP\n7,5,5\n7,5,300", "TMP must be in [-60, 60] c, got 300 in row 2"),
        ("WS,WD,FFMC\n7,5,102", "FFMC must be in [0, 101], got 102 in row 1"),
        ("WS,WD\n1,5,6", "rows must have 2 cells as the header, got 3 in row 1"),
        ("WS,WD", "weather must have a header and a row, got 1 lines"),
        ("datetime,WS,WD\n2018-08-10 1:00,1,5\nnoon,1,5", "times of weather must be dates and times of one form, got"),
        (
            "datetime,WS,WD\n2018-08-10 2:00,1,5\n2018-08-10 1:00,1,5",
            "times of weather must grow, got '2018-08-10 1:00' after '2018-08-10 2:00' in row 2",
        ),
        ("hours,WS,WD\n0,1,5\none,1,5", "hours must be a number, got 'one' in row 2"),
        ("hours,WS,WD\n0,1,5\n2,1,5\n2,1,5", "times of weather must grow, got '2' after '2' in row 3"),
    ],
)
def test_what_is_wrong_is_refused_in_one_line(table, text, words):
    with pytest.raises(ValueError) as refusal:
        table(text)
    file, _, told = str(refusal.value).partition("weather.csv: ")
    assert file and told.startswith(words) and "\n" not in told


def test_options_and_files_are_checked(table, tmp_path):
    with pytest.raises(ValueError, match="wind_height must be 10m or 20ft or null, got '2m'"):
        table("WS,WD\n1,5", wind_height="2m")
    with pytest.raises(ValueError, match=r"start_ffmc must be in \[0, 101\], got 150"):
        table("WS,WD\n1,5", start_ffmc=150)
    with pytest.raises(ValueError, match=r"bui must be in \[0, 2000\], got -1"):
        table("WS,WD\n1,5", bui=-1)
    with pytest.raises(ValueError, match=r"weather must be a CSV file that can be read, got .*none.csv: No such file"):
        read_weather(tmp_path / "none.csv")
