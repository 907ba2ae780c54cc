"""Escape of fires by wind, arrival and number of vehicles: what is varied, and how it is told."""

import pytest

from tests.world.mechanics.there import needs_scenario
from warp_torchrl.benchmark.attack import VALUES, attack_table, draw_attack, escapes
from warp_torchrl.runs.config.construction import ConfigError

pytestmark = needs_scenario("initial_attack")
SMALL = ("landscape.size=16", "horizon=20", "mechanics.values.escape_area=2", "fire.fire_deviation=0")


def test_fires_that_nobody_fights_escape_and_those_fought_at_once_do_not():
    calm = (*SMALL, "wind.speed=1", "wind.speed_deviation=0", "ignition.head_start=0")
    late, soon = escapes("initial_attack", "cpu", 4, {"minutes": (1000.0, 0.0)}, ("noop", "dispatch"), overrides=calm)
    assert late["axis"] == "minutes" and late["value"] == 1000.0 and late["escaped"]["noop"] == soon["escaped"]["noop"]
    assert late["escaped"]["dispatch"] == late["escaped"]["noop"], "nobody has come"
    assert soon["escaped"]["dispatch"]["mean"] <= late["escaped"]["dispatch"]["mean"]


def test_one_thing_changes_at_a_time_and_a_trained_team_plays_beside():
    values = {"winds": (0.0, 9.0), "vehicles": (3,)}
    rows = escapes("initial_attack", "cpu", 2, values, ("noop",), team="skirmish", overrides=SMALL)
    assert [(row["axis"], row["value"]) for row in rows] == [("winds", 0.0), ("winds", 9.0), ("vehicles", 3)]
    assert all(list(row["escaped"]) == ["noop", "skirmish"] for row in rows)
    assert rows[0]["escaped"]["noop"]["mean"] < rows[1]["escaped"]["noop"]["mean"], "the wind carries a fire over 2 ha"


def test_a_scenario_that_does_not_tell_of_escapes_is_refused():
    with pytest.raises(ConfigError, match=r"scenario must tell which fires escape, mechanics\.values, got skirmish"):
        escapes("skirmish", "cpu", 2, VALUES)


def test_each_thing_has_a_table_and_a_panel(tmp_path):
    found = {"mean": 0.25, "ci95": (0.125, 0.5)}
    rows = [
        {"axis": axis, "value": value, "episodes": 8, "escaped": {"noop": found, "dispatch": {**found, "mean": 0.0}}}
        for axis in ("winds", "vehicles")
        for value in (2.0, 4.0)
    ]
    lines = attack_table(rows).splitlines()
    assert lines[0] == "Fires that escape, % of 8, seeds from 1000000, and 95 % intervals"
    assert lines[2].split("  ")[0] == "wind [m/s]" and lines[3].split() == ["2", "25", "(12..50)", "0", "(12..50)"]
    pytest.importorskip("matplotlib", reason="the figure needs the extra figures")
    draw_attack(rows, tmp_path / "attack.png")
    assert (tmp_path / "attack.png").stat().st_size > 10_000
