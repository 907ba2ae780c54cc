"""Times of rows: three rows an hour apart in the forms in which weather comes, and what cannot be read in one way."""

import logging
from datetime import datetime
from zoneinfo import ZoneInfo, available_timezones

import pytest

from warp_torchrl.system.provenance import gathered
from warp_torchrl.world.weather.dates import read_stamp
from warp_torchrl.world.weather.table import minutes_until, read_weather


@pytest.fixture
def write(tmp_path):
    def write(header, *rows):
        path = tmp_path / "weather.csv"
        path.write_text(f"{header},WS,WD\n" + "".join(f"{row},8,270\n" for row in rows), encoding="utf-8")
        return path

    return write


HOURLY = {  # header, three rows an hour apart
    "no seconds": ("datetime", "2024-07-01T12:00", "2024-07-01T13:00", "2024-07-01T14:00"),
    "an offset": ("datetime", "2024-07-01T12:00:00-07:00", "2024-07-01T13:00:00-07:00", "2024-07-01T14:00:00-07:00"),
    "an offset of four digits": (
        "Date_Time",
        "2024-07-01T12:00-0700",
        "2024-07-01T13:00-0700",
        "2024-07-01T14:00-0700",
    ),
    "an offset of two digits": ("time", "2024-07-01 12:00-07", "2024-07-01 13:00-07", "2024-07-01 14:00-07"),
    "Z": ("valid_time", "2024-07-01T12Z", "2024-07-01T13Z", "2024-07-01T14Z"),
    "an offset behind a space": (
        "datetime",
        "2024-07-01 12:00 +02:00",
        "2024-07-01 13:00 +02:00",
        "2024-07-01 14:00 +02:00",
    ),
    "a zone in brackets": ("datetime", *(f"2024-07-01T{hour}:00+02:00[Europe/Berlin]" for hour in (12, 13, 14))),
    "a zone as a word": ("Date_Time", "07/01/2024 12:00 PDT", "07/01/2024 13:00 PDT", "07/01/2024 14:00 PDT"),
    "an offset and UTC": ("dt_iso", *(f"2024-07-01 {hour}:00:00 +0000 UTC" for hour in (12, 13, 14))),
    "mixed offsets": ("datetime", "2024-07-01T12:00-07:00", "2024-07-01T20:00Z", "2024-07-01T23:00+02:00"),
    "the end of summer time": ("time", "2024-11-03T01:00-07:00", "2024-11-03T01:00-08:00", "2024-11-03T02:00-08:00"),
    "its words": ("time", "11/03/2024 01:00 PDT", "11/03/2024 01:00 PST", "11/03/2024 02:00 PST"),
    "its start": ("time", "2024-03-10T01:00-08:00", "2024-03-10T03:00-07:00", "2024-03-10T04:00-07:00"),
    "hour 24": ("date,hour", "2024-07-01,23", "2024-07-01,24", "2024-07-02,1"),
    "24:00": ("datetime", "2024-12-31 23:00", "2024-12-31 24:00", "2025-01-01 01:00"),
    "ten digits": ("datetime", "2024070123", "2024070124", "2024070201"),
    "twelve digits": ("datetime", "202407012300", "202407012400", "202407020100"),
    "fourteen digits": ("local_date_time_full", "20240701230000", "20240702000000", "20240702010000"),
    "hours and minutes": ("Year,Mth,Day,Time", "2024,7,1,2300", "2024,7,1,2400", "2024,7,2,100"),
    "no leading zeros": ("date,time", "2024-7-1,0000", "2024-7-1,100", "2024-7-1,200"),
    "two digits of the year": ("datetime", "24-07-01 23:00", "24-07-02 00:00", "24-07-02 01:00"),
    "two digits of a year": ("yr,mon,day,hr", "24,7,1,23", "24,7,2,0", "24,7,2,1"),
    "AM and PM": ("datetime", "7/1/2024 11:00 AM", "7/1/2024 12:00 PM", "7/1/2024 1:00 PM"),
    "midnight of AM": ("datetime", "6/30/2024 11:00 p.m.", "7/1/2024 12:00 a.m.", "7/1/2024 1:00 a.m."),
    "fractions of seconds": ("datetime", *(f"2024-07-01T{hour}:00:00.000" for hour in (12, 13, 14))),
    "seconds since 1970": ("dt", "1719835200", "1719838800", "1719842400"),
    "milliseconds": ("timestamp", "1719835200000", "1719838800000", "1719842400000"),
    "the day of the year": ("year,doy,hour", "2024,183,23", "2024,184,0", "2024,184,1"),
    "the day of the year in one": ("datetime", "2024-183T23:00", "2024-184T00:00", "2024-184T01:00"),
    "minutes in a column": ("year,month,day,hour,minute", "2024,7,1,12,30", "2024,7,1,13,30", "2024,7,1,14,30"),
    "an hour beside dates at midnight": ("date,hour", *(f"2024-07-01 00:00:00,{hour}" for hour in (12, 13, 14))),
    "hours with a point": ("date,hour", "2024-07-01,12.0", "2024-07-01,13.0", "2024-07-01,14.0"),
    "the name of the month": ("datetime", "30-Jun-2024 23:00", "01-Jul-2024 00:00", "01-Jul-2024 01:00"),
    "a day of the week": ("datetime", *(f'"Mon, 01 Jul 2024 {hour}:00:00 GMT"' for hour in (12, 13, 14))),
    "an index without a name": ("", "2024-07-01 12:00:00", "2024-07-01 13:00:00", "2024-07-01 14:00:00"),
    "day first": ("datetime", "30/06/2024 23:00", "01/07/2024 00:00", "01/07/2024 01:00"),
    "day first, by the rows": ("datetime", "01.07.2024 23:00", "02.07.2024 00:00", "02.07.2024 01:00"),
    "month first, by the rows": ("datetime", "07/01/2024 23:00", "07/02/2024 00:00", "07/02/2024 01:00"),
    "a date and a time of spreadsheets": ("Date,Time", "7/1/2024,11:00 PM", "7/2/2024,12:00 AM", "7/2/2024,1:00 AM"),
    "the newest above": ("datetime", "2024-07-01 14:00", "2024-07-01 13:00", "2024-07-01 12:00"),
}


@pytest.mark.parametrize("form", HOURLY)
def test_rows_an_hour_apart_are_an_hour_apart_in_every_form(write, form, caplog):
    assert read_weather(write(*HOURLY[form])).hours.tolist() == [0, 1, 2]
    assert not caplog.records or form == "the newest above"


ZONES = ("Europe/Lisbon", "Europe/London", "Europe/Berlin", "Europe/Athens", "Australia/Sydney", "Australia/Adelaide",
         "Australia/Perth", "America/New_York", "America/Chicago", "America/Denver", "America/Los_Angeles",
         "America/Anchorage", "America/St_Johns", "America/Halifax", "UTC")  # fmt: skip


@pytest.mark.skipif(not available_timezones(), reason="this system has no time zones")
@pytest.mark.parametrize("zone", ZONES)
@pytest.mark.parametrize("month", [1, 7])
def test_words_behind_a_time_are_those_of_their_zones(zone, month):
    at = datetime(2024, month, 1, 12, tzinfo=ZoneInfo(zone))
    assert read_stamp(f"2024-{month:02}-01 12:00 {at.tzname()}").offset == at.utcoffset().total_seconds() / 3600.0


def test_a_month_first_year_is_not_a_day_first_one(write):
    # Read as 24 July 2001 and 24 July 2002 the rows were 8737 hours apart, as 7 January and 7 February 744
    assert read_weather(write("date", "24-07-01", "24-07-02")).hours.tolist() == [0, 24]
    assert read_weather(write("date", "01/07/2024", "02/07/2024")).hours.tolist() == [0, 24]


def test_years_first_are_read_as_they_stand_however_far_apart(write):
    # As year-day-month the second row would be a day later; nobody writes that
    assert read_weather(write("date", "2024-01-07", "2024-02-07")).hours.tolist() == [0, 744]


def test_dates_that_can_be_read_in_two_ways_are_refused_until_the_user_says_which(write):
    path = write("datetime", "01/02/2024 12:00", "02/03/2024 12:00")
    with pytest.raises(ValueError) as refusal:
        read_weather(path)
    assert str(refusal.value).partition("weather.csv: ")[2] == (
        "times of weather can be read as d/m/y or m/d/y, got '01/02/2024 12:00' to '02/03/2024 12:00': write years "
        "first, as in 2024-07-01, or say units.datetime=d/m/y"
    )
    assert read_weather(path, units={"datetime": "d/m/y"}).hours.tolist() == [0, 30 * 24]
    assert read_weather(path, units={"datetime": "m/d/y"}).hours.tolist() == [0, 32 * 24]
    with pytest.raises(ValueError, match=r"times of weather must be dates .* got '01/02/2024 12:00' in row 1"):
        read_weather(path, units={"datetime": "y/m/d"})
    with pytest.raises(ValueError, match=r"units.datetime must be y/m/d, d/m/y, m/d/y, got dmy"):
        read_weather(path, units={"datetime": "dmy"})


@pytest.mark.parametrize(
    ("header", "rows", "words"),
    [
        ("time", ("2024-11-03 01:00", "2024-11-03 01:00", "2024-11-03 02:00"), "times of weather must grow, got"),
        ("time", ("2024-07-01T12:00Z", "2024-07-01T13:00"), "times of weather must all have an offset or none, got '2"),
        ("time", ("2024-02-30 12:00", "2024-03-01 12:00"), "times of weather must be dates and times of one form, got"),
        ("date,hour", ("2024-07-01,24", "2024-07-01,25"), "times of weather must be dates and times of one form, got"),
        ("time", ("2024-07-01 23:30", "2024-07-01 24:30"), "times of weather must be dates and times of one form, got"),
        ("time", ("2024-07-01 13:00 PM",), "times of weather must be dates and times of one form, got '2024-07-01 13:"),
        ("time", ("2024-07-01 12:60",), "times of weather must be dates and times of one form, got '2024-07-01 12:60'"),
        ("time", ("2024-07-01 12:00 XYZ",), "times of weather must be dates and times of one form, got '2024-07-01 1"),
        ("time", ("2024-07-01 12:00", "13:00"), "times of weather must be dates and times of one form, got '13:00' in"),
        ("time", ("2024-07-01 12:00", ""), "times of weather must be dates and times of one form, got '' in row 2"),
        ("datetime", ("45474.5", "45474.6"), "times of weather must be dates and times of one form, got '45474.5' in"),
    ],
)
def test_times_that_are_none_are_refused(write, header, rows, words):
    with pytest.raises(ValueError) as refusal:
        read_weather(write(header, *rows))
    assert str(refusal.value).partition("weather.csv: ")[2].startswith(words)


def test_a_gap_is_named(write, caplog):
    path = write("datetime", "2024-07-01 12:00", "2024-07-01 13:00", "2024-07-01 14:00", "2024-07-03 00:00")
    with gathered() as files:
        assert read_weather(path).hours.tolist() == [0, 1, 2, 36]
    line = "34 hours without weather after '2024-07-01 14:00' (row 3), where rows are 1 hours apart; that row holds on"
    assert caplog.messages == [f"weather: {line}"] and files[0].notes[-1] == line
    caplog.clear()
    read_weather(write("hours", 0, 1, 2, 12))  # ten times is not more than ten times
    assert not caplog.messages
    read_weather(write("date", "2024-07-01", "2824-07-01"))  # of two rows, too, where it is over a month
    assert "hours without weather after '2024-07-01' (row 1)" in caplog.text
    caplog.clear()
    read_weather(write("hours", *range(0, 100, 20), *range(300, 1000, 300)))
    assert not [text for text in caplog.messages if "more" in text] and len(caplog.messages) == 3


def test_times_without_dates_go_over_midnight_and_the_log_says_so(write, caplog):
    with caplog.at_level(logging.WARNING, logger="warp_torchrl"):
        assert read_weather(write("hour", 22, 23, 0, 1)).hours.tolist() == [0, 1, 2, 3]
        assert read_weather(write("time", "23:00", "0:00", "5:00", "1:00")).hours.tolist() == [0, 1, 6, 26]
    assert {text.partition(";")[0] for text in caplog.messages} == {"weather: no column tells the date"}


def test_rows_that_fall_in_time_carry_their_weather_with_them(tmp_path):
    (tmp_path / "a.csv").write_text("time,WS,WD\n2024-07-01 14:00,36,3\n2024-07-01 13:00,18,2\n2024-07-01 12:00,0,1\n")
    weather = read_weather(tmp_path / "a.csv")
    assert weather.wind_speed.tolist() == [0, 5, 10] and weather.wind_bearing.tolist() == [1, 2, 3]
    assert minutes_until("2024-07-01 12:30", tmp_path / "a.csv") == 30


LOCAL = ("time", "2024-07-01T12:00-07:00", "2024-07-01T13:00-07:00")
SUMMER = ("time", "2024-07-01T12:00", "2024-07-01T13:00")


@pytest.mark.parametrize(
    ("table", "start", "minutes"),
    [
        (LOCAL, "2024-07-01T12:30-07:00", 30),
        (LOCAL, "2024-07-01T19:30Z", 30),
        (LOCAL, "2024-07-01 12:30", 30),
        (("time", "2024-07-01T12:00Z", "2024-07-01T13:00Z"), "2024-07-01T14:15+02:00", 15),
        (SUMMER, "2024-07-01 12:45", 45),
        (SUMMER, "01.07.2024 12:45", 45),  # 7 January is not among the rows
        (("time (UTC)", *SUMMER[1:]), "2024-07-01T05:30-07:00", 30),
        (('"Date Time, GMT-07:00"', "07/01/24 12:00:00 PM", "07/01/24 01:00:00 PM"), "2024-07-01T19:30Z", 30),
        (("timestamp_utc", "2024-07-01 12:00:00", "2024-07-01 13:00:00"), "2024-07-01T12:30Z", 30),
        (("dt", "1719835200", "1719838800"), "2024-07-01T12:30Z", 30),
        (("datetime", "24-07-01 12:00", "24-07-01 13:00"), "2024-07-01 12:30", 30),
        (("datetime", "05/07/2024 12:00", "06/07/2024 12:00"), "05/07/2024 13:00", 60),
        (("datetime", "05/07/2024 12:00", "06/07/2024 12:00"), "2024-07-06 00:00", 720),
        (("date,hour", "2024-07-01,12", "2024-07-01,13"), "2024-07-01 12:30", 30),
    ],
)
def test_a_start_is_on_the_clock_of_its_offset_or_of_the_rows(write, table, start, minutes):
    assert minutes_until(start, write(*table)) == pytest.approx(minutes, abs=1e-3)


@pytest.mark.parametrize(
    ("table", "start", "words"),
    [
        (SUMMER, "2024-07-01T12:00-07:00", "start must have no offset where the rows have none, '2024-07-01T12:00'"),
        (HOURLY["the end of summer time"], "2024-11-03 01:30", "start must have an offset where rows have several"),
        (SUMMER, "noon", "start must be a date and time as the first row has it, '2024-07-01T12:00', got 'noon'"),
        (SUMMER, "12:30", "start must be a date and time as the first row has it, '2024-07-01T12:00', got '12:30'"),
        (SUMMER, "2024-02-30", "start must be a date and time as the first row has it, '2024-07-01T12:00', got '2024-"),
        (("hours", "0", "1"), "2024-07-01 12:00", "start must be in minutes where rows tell no dates and times of the"),
        (
            ("datetime", "05/07/2024 12:00", "05/07/2024 13:00"),
            "2024-05-07 12:00",
            None,  # 5 July or 7 May: the rows' own hours say nothing, but the start lies among them in one way alone
        ),
    ],
)
def test_a_start_that_does_not_fit_is_refused(write, table, start, words):
    if words is None:
        assert minutes_until(start, write(*table)) == 0
        return
    with pytest.raises(ValueError) as refusal:
        minutes_until(start, write(*table))
    assert str(refusal.value).startswith(words)


def test_open_meteo_says_its_offset_above_the_table(tmp_path):
    (tmp_path / "a.csv").write_text(
        "latitude,utc_offset_seconds\n52.5,7200\n\ntime,wind_speed_10m (km/h),wind_direction_10m (°)\n"
        "2024-07-01T12:00,18,270\n2024-07-01T13:00,18,270\n"
    )
    assert minutes_until("2024-07-01T10:30Z", tmp_path / "a.csv") == pytest.approx(30)


def test_reanalyses_are_in_utc(tmp_path):
    (tmp_path / "a.csv").write_text("valid_time,u10,v10\n2024-07-01 12:00:00,3,4\n2024-07-01 13:00:00,3,4\n")
    assert minutes_until("2024-07-01T14:30+02:00", tmp_path / "a.csv") == pytest.approx(30)


@pytest.mark.parametrize(
    "text", ["", "x", "2024", "1-2", "2024-7", "1/2/3/4", "12:00:00:00", "2024-07-01T", "001-002-003"]
)
def test_what_is_no_date_and_no_time_has_no_parts(text):
    stamp = read_stamp(text)
    assert stamp is None or (stamp.numbers is None and text == "2024")
