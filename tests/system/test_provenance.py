"""Provenance: a line for each file, told once, gathered by whoever asks."""

import json
import logging

from warp_torchrl.system.provenance import Provenance, gathered, report_file, section

WEATHER = Provenance(
    key="weather",
    file="station.csv",
    read={"WS": "wind_speed, km/h", "FFMC": ""},
    left=("GUST", "VIS"),
    notes=("wind is that at 10 m",),
)


def test_a_line_names_what_was_read_in_which_unit_and_what_was_left():
    assert WEATHER.line == (
        "weather: station.csv: read WS [wind_speed, km/h], FFMC; left GUST, VIS; wind is that at 10 m"
    )
    assert Provenance(key="fuel", file="fuel.tif").line == "fuel: fuel.tif: read nothing"


def test_what_is_told_is_logged_once_and_gathered_by_the_innermost_block(caplog):
    caplog.set_level(logging.INFO, "warp_torchrl")
    one = Provenance(key="elevation", file="told once.tif", read={"band 1": "m"})
    with gathered() as outer:
        report_file(one)
        with gathered() as inner:
            report_file(WEATHER)
        report_file(one)
    report_file(WEATHER)
    assert outer == [one] and inner == [WEATHER]
    assert [record.getMessage() for record in caplog.records].count(one.line) == 1


def test_plain_values_make_the_same_again():
    assert Provenance.of_values(json.loads(json.dumps(WEATHER.as_values))) == WEATHER


def test_a_report_has_a_line_a_file_and_nothing_of_none():
    assert section([]) == []
    assert section([WEATHER.as_values])[-1] == f"- {WEATHER.line}"


def test_names_of_a_stranger_are_one_line_without_markup():
    nasty = Provenance(
        key="weather",
        file="a\nb\x1b[2J.csv",
        read={"<script>": "x](http://elsewhere", "W" * 500: "m"},
        left=tuple(f"c{number}" for number in range(1000)),
    )
    (line,) = section([nasty.as_values])[3:]
    assert line.isprintable() and "<" not in line and "](" not in line
    assert "W" * 120 + "..." in line and "W" * 121 not in line and "and 960 more" in line
