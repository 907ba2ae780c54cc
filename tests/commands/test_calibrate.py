"""The command, from files to a law that ``fire=`` takes."""

import json

import pytest
import torch
import yaml

from warp_torchrl.commands import calibrate as command
from warp_torchrl.commands.calibrate import main
from warp_torchrl.commands.failure import DONE, IN_USE, MISTAKE
from warp_torchrl.prediction.calibration.case import read_fire_case
from warp_torchrl.prediction.calibration.fitting import Shrinkage
from warp_torchrl.prediction.calibration.options import CalibrationOptions
from warp_torchrl.runs.config.compose import option_of
from warp_torchrl.runs.config.construction import ConfigError, build
from warp_torchrl.runs.config.plain_values import plain
from warp_torchrl.runs.config.saved_config import SavedConfig, restore
from warp_torchrl.system.lock import RunFolderLock

rasterio = pytest.importorskip("rasterio", reason="rasters need the extra gis")


def write(folder, **outcome):
    """Write a fire as a folder: grass on level ground, three hours of wind from the west."""
    folder.mkdir()
    header = "ncols 24\nnrows 20\nxllcorner 0\nyllcorner 0\ncellsize 50\nNODATA_value -9999\n"
    grids = {"fuel": torch.full((20, 24), 31), **outcome}
    for name, values in grids.items():
        lines = [" ".join(f"{value:g}" for value in row) for row in values.tolist()]
        (folder / f"{name}.asc").write_text(header + "\n".join(lines) + "\n")
    (folder / "ignition.csv").write_text("row,column\n10,4\n")
    (folder / "weather.csv").write_text(
        "datetime,WS,WD,FFMC,BUI\n" + "".join(f"2020-07-01 {h}:00,8,270,84,40\n" for h in (12, 13))
    )
    return folder


def scar():
    cells = torch.zeros(20, 24)
    cells[8:13, 3:14] = 1.0
    return cells


def test_a_fire_is_read_from_a_folder(tmp_path):
    case = read_fire_case(write(tmp_path / "small", scar=scar()))
    assert case.name == "small" and case.cell_size == 50.0 and case.last == 120.0 and case.arrival is None
    assert int(case.scar.sum()) == 55 and case.lit.nonzero().tolist() == [[10, 4]]
    assert case.wind.tolist() == pytest.approx([8 / 3.6, 0.0], abs=1e-4)


def test_weather_and_ignition_are_read_as_a_prediction_reads_them(tmp_path):
    folder = write(tmp_path / "small", scar=scar())
    plain = read_fire_case(folder)
    rows = "".join(f"2020-07-01 {h}:00;8,0;270;84;40\n" for h in (12, 13))
    (folder / "weather.csv").write_text(f"datetime;WindSpeed;WD;FFMC;BUI\n{rows}")
    (folder / "ignition.csv").write_text("x;y\n225,0;475,0\n")
    with pytest.raises(ValueError, match=r"small: .*WindSpeed must name its unit"):
        read_fire_case(folder)
    case = read_fire_case(folder, units={"WindSpeed": "km/h"})
    assert torch.equal(case.wind, plain.wind) and torch.equal(case.lit, plain.lit)


def test_times_of_arrival_make_an_outcome_by_the_hour(tmp_path):
    times = torch.full((20, 24), -9999.0)
    times[10, 4:8] = torch.tensor([0.0, 30.0, 70.0, 110.0])
    case = read_fire_case(write(tmp_path / "timed", arrival=times))
    assert case.minutes.tolist() == [60.0, 120.0] and case.burned.sum((1, 2)).tolist() == [2, 4]


def test_perimeters_make_an_outcome_by_their_hours(tmp_path):
    ring = [[100, 500], [500, 500], [500, 700], [100, 700], [100, 500]]
    feature = {"type": "Feature", "properties": {"hours": 1}, "geometry": {"type": "Polygon", "coordinates": [ring]}}
    folder = write(tmp_path / "seen")
    (folder / "perimeters.geojson").write_text(json.dumps({"type": "FeatureCollection", "features": [feature]}))
    case = read_fire_case(folder)
    assert case.minutes.tolist() == [60.0] and int(case.scar.sum()) == 8 * 4


def test_the_law_is_scored_fitted_and_written(tmp_path, capsys):
    folder = write(tmp_path / "small", scar=scar())
    given = [f"fires=[{folder}]", "fire.model=fbp", "parameters=[rate_gain]", "draws=4", "steps=2", "hours=1"]
    assert main([*given, f"out={tmp_path / 'out'}"]) == DONE
    assert "| small | uncalibrated |" in capsys.readouterr().out
    found = json.loads((tmp_path / "out" / "calibration.json").read_text())
    assert set(found["scores"]["small"]) == {"circle", "ellipse", "walking ellipse", "uncalibrated", "fitted"}

    law = build(yaml.safe_load((tmp_path / "out" / "fire" / "calibrated.yaml").read_text()), "fire")
    assert law.model == "fbp" and law.rate_gain == pytest.approx(found["parameters"]["rate_gain"], rel=1e-4) != 1.0


@pytest.mark.parametrize(
    ("given", "line"),
    [
        ([], "fires must name folders of fires that happened, got none"),
        (["fires=[nowhere]"], "fires must name folders that exist, got nowhere"),
        (["fires=[a]", "parameters=[speed]"], "parameters must be of"),
        (["fires=[a]", "hours_by_fire.b=3"], "hours_by_fire must name some of a, got b"),
        (["fires=[a]", "hours_by_fire.a=0"], "hours_by_fire.a must be in [0.01, 100000], got 0"),
        (["fires=[a]", "fire=hazard"], "fire must be a law of metres and minutes, rate, got HazardFire"),
        (["fires=[a]", "draw=3"], "draw is not a key of the configuration"),
        (["fires=[a]", "method=gradients", "loss=jaccard"], "loss must be cross_entropy or brier"),
    ],
)
def test_a_refusal_is_one_line(given, line, capsys):
    assert main(given) == MISTAKE
    assert line in capsys.readouterr().err.strip().splitlines()[-1]


def test_each_fire_may_have_its_own_hour():
    options = CalibrationOptions(fires=("fires/first", "fires/second"), hours=2.0, hours_by_fire={"second": 1.0})
    assert [options.hours_of(each) for each in options.fires] == [2.0, 1.0]


@pytest.mark.parametrize(
    ("change", "line"),
    [
        ({"ignition.csv": "row,column\n20,4\n"}, "small: ignition must have points on the map of 20 x 24 cells"),
        ({"scar.asc": None}, "small: the outcome must be scar"),
        ({"weather.csv": None}, "small: weather must be weather.csv"),
        ({"fuel.asc": None}, "small: fuel must be fuel.tif or fuel.asc"),
    ],
)
def test_a_fire_that_is_not_whole_is_refused_in_one_line(tmp_path, change, line):
    folder = write(tmp_path / "small", scar=scar())
    for name, content in change.items():
        (folder / name).unlink() if content is None else (folder / name).write_text(content)
    with pytest.raises(ValueError, match=line) as error:
        read_fire_case(folder)
    assert "\n" not in str(error.value)


def test_a_run_keeps_a_law_of_a_user_s_own_file_by_ours_of_its_class_and_every_value():
    target = "warp_torchrl.world.law.rate.RateFire"
    assert option_of("fire", target) == "rate"
    with pytest.raises(ConfigError, match=r"fire\._target_ must be a class that an option of conf/fire names"):
        option_of("fire", "warp_torchrl.world.law.rate.Nothing")
    kept = SavedConfig(choices={"fire": "rate"}, values={"fire": {"rate_gain": 1.2, "fuel_gain": {"2": 0.9}}})
    law = build(plain(restore(kept))["fire"], "fire")
    assert law.rate_gain == 1.2 and law.bed.fuel_gain == {"2": 0.9}


def test_a_calibration_replaces_an_earlier_one_and_nothing_else(tmp_path, monkeypatch):
    out, fires = tmp_path / "out", f"fires=[{write(tmp_path / 'small', scar=scar())}]"
    monkeypatch.setattr(command, "_fit", lambda fire, *_: (fire, Shrinkage(1.0)))
    given = [fires, "fire.model=fbp", "draws=1", f"out={out}"]
    assert main([*given, "parameters=[rate_gain]"]) == DONE and (out / "fire" / "calibrated.yaml").exists()
    (out / "fire" / "own.yaml").write_text("mine")
    assert main(given) == MISTAKE and main([*given, "overwrite=true"]) == DONE
    there = {path.relative_to(out).as_posix() for path in out.rglob("*") if path.is_file()}
    assert there - {".lock"} == {"calibration.json", "calibration.md", "fire/own.yaml", "scores.log"}


def test_two_calibrations_into_one_folder_are_refused_before_the_work(tmp_path, monkeypatch, capsys):
    monkeypatch.setattr(command, "read_fire_case", lambda *_: pytest.fail("it began to work"))
    lock = RunFolderLock(tmp_path / "out")
    try:
        assert main([f"fires=[{tmp_path}]", f"out={tmp_path / 'out'}"]) == IN_USE
    finally:
        lock.release()
    assert capsys.readouterr().err.count("\n") == 1


def test_a_calibration_that_ends_in_the_middle_leaves_its_scores_alone(tmp_path, monkeypatch):
    def interrupted(*_):
        raise KeyboardInterrupt

    monkeypatch.setattr(command, "law_yaml", interrupted)
    monkeypatch.setattr(command, "_fit", lambda fire, *_: (fire, Shrinkage(1.0)))
    fires = f"fires=[{write(tmp_path / 'small', scar=scar())}]"
    with pytest.raises(KeyboardInterrupt):
        main([fires, "fire.model=fbp", "draws=1", "parameters=[rate_gain]", f"out={tmp_path / 'out'}"])
    there = {path.name for path in (tmp_path / "out").iterdir()}
    assert there - {".lock"} == {"scores.log"}
    models = [json.loads(line)["model"] for line in (tmp_path / "out" / "scores.log").read_text().splitlines()]
    assert models == ["circle", "ellipse", "walking ellipse", "uncalibrated"]


def test_a_fit_that_would_hurt_the_fire_left_out_is_shrunk_to_none(tmp_path, monkeypatch):
    class Far:
        def __call__(self, fire, parameters, cases, progress=None):
            return torch.tensor([4.0])

    monkeypatch.setattr(CalibrationOptions, "fit", property(lambda self: Far()))
    fires = [write(tmp_path / name, scar=scar()) for name in ("first", "second")]
    given = [f"fires=[{fires[0]},{fires[1]}]", "fire.model=fbp", "draws=2", "parameters=[rate_gain]", "hours=2"]
    assert main([*given, f"out={tmp_path / 'out'}"]) == DONE
    found = json.loads((tmp_path / "out" / "calibration.json").read_text())
    rows = found["scores"]["first"]
    assert rows["left out, whole fit"]["jaccard"] < rows["uncalibrated"]["jaccard"]
    assert found["share"] < 1.0 and rows["left out"]["jaccard"] >= rows["left out, whole fit"]["jaccard"]
    assert "share of the fit that the law has" in (tmp_path / "out" / "calibration.md").read_text()
