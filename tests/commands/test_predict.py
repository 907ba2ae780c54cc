"""The command predict: from rasters and a table of weather to maps, a report and refusals in one line."""

import json
from importlib.util import find_spec
from pathlib import Path

import numpy as np
import pytest
import yaml
from PIL import Image

from tests.world.rasters import rasterio, read, write
from warp_torchrl.commands.predict import main
from warp_torchrl.runs.config.prediction import compose_prediction
from warp_torchrl.world.terrain.layer import read_grid

FIRES = Path(__file__).parents[3] / "shared" / "fires"
SHAPE = (40, 44)
MAPS = ("burn_probability.tif", "arrival_hours.tif", "rate.tif", "intensity.tif", "flame_length.tif")

DRAWN = ("test_every_output_is_there_and_lies_where_the_fuel_does",)
"""Tests of the figures."""


@pytest.fixture(autouse=True)
def _figures(request):
    if request.node.name not in DRAWN and find_spec("matplotlib") is not None:
        request.getfixturevalue("blank_figures")


@pytest.fixture
def folder(tmp_path):
    """A folder of even grass in a west wind, with a lake in the north."""
    fuel = np.full(SHAPE, 31)
    fuel[:4] = 102
    write(tmp_path / "fuel.tif", fuel, "int16", cell=50.0, crs="EPSG:32631", west=5e5)
    write(tmp_path / "elevation.tif", np.full(SHAPE, 100.0), cell=50.0, crs="EPSG:32631", west=5e5)
    rows = "\n".join(f"2024-07-01 {hour}:00,10.8,270,90" for hour in (12, 13, 14))
    (tmp_path / "weather.csv").write_text(f"datetime,WS,WD,FFMC\n{rows}\n")
    (tmp_path / "ignition.csv").write_text("row,column\n20,10\n")
    return tmp_path


def arguments(folder, **changes):
    given = {
        "landscape.path": folder,
        "landscape.fuel": "fuel.tif",
        "landscape.elevation": "elevation.tif",
        "landscape.table": "fbp",
        "fire.model": "fbp",
        "weather": folder / "weather.csv",
        "ignition": folder / "ignition.csv",
        "out": folder / "out",
        "hours": 1,
        "fires": 8,
    }
    return [f"{key}={value}" for key, value in {**given, **changes}.items()]


def test_every_output_is_there_and_lies_where_the_fuel_does(folder, capsys):
    assert main(arguments(folder, animation="true")) == 0
    grid = read_grid("fuel", folder / "fuel.tif")
    for name in MAPS:
        with rasterio.open(folder / "out" / name) as layer:
            assert (layer.crs, layer.transform, layer.shape) == (grid.crs, grid.transform, SHAPE), name
    chance, hours = read(folder / "out" / "burn_probability.tif"), read(folder / "out" / "arrival_hours.tif")
    assert chance[20, 10] == 1.0 and (chance[:4] == 0.0).all() and chance.max() <= 1.0
    assert hours[20, 10] == 0.0 and np.nanmax(hours) <= 1.0 and np.array_equal(np.isnan(hours), chance == 0.0)
    shapes = json.loads((folder / "out" / "perimeters.geojson").read_text())["features"]
    assert shapes[-1]["properties"]["hours"] == 1.0
    assert shapes[-1]["properties"]["area_ha"] == pytest.approx((chance >= 0.5).sum() * 0.25)
    assert Image.open(folder / "out" / "fire.gif").n_frames > 50 and Image.open(folder / "out" / "maps.png").width > 500
    report = json.loads((folder / "out" / "report.json").read_text())
    assert report["fires"] == 8 and len(report["by_hour"]) == 2 and report["version"] and report["left_map"] == 0.0
    assert report["inputs"]["grid convergence [degrees]"] == pytest.approx(0.0, abs=0.05)  # at the zone's middle
    assert "| 1 |" in capsys.readouterr().out and (folder / "out" / "report.md").exists()


def test_a_start_is_a_moment_or_minutes(folder):
    for number, start in enumerate(("60", "'2024-07-01 13:00'")):
        assert main(arguments(folder, start=start, out=folder / f"out{number}")) == 0
    told = [json.loads((folder / f"out{number}" / "report.json").read_text()) for number in range(2)]
    assert told[0]["by_hour"] == told[1]["by_hour"]
    assert told[1]["inputs"]["start [minutes after the first row]"] == 60.0


def test_units_that_the_file_does_not_state_are_those_that_the_user_says(folder):
    rows = "\n".join(f"2024-07-01T{hour}:00-07:00;10,8;270;90;3" for hour in (12, 13, 14))
    (folder / "plain.csv").write_text(f"sep=;\ndatetime;WindSpeed;WD;FFMC;Gust\n{rows}\n")
    given = {"weather": folder / "plain.csv", "units.WindSpeed": "km/h", "start": "2024-07-01T20:00Z"}
    assert main(arguments(folder, start=60)) == 0 and main(arguments(folder, **given, out=folder / "other")) == 0
    one, other = (json.loads((folder / name / "report.json").read_text()) for name in ("out", "other"))
    assert one["by_hour"] == other["by_hour"]
    told = next(each for each in other["files"] if each["key"] == "weather")
    assert told["read"]["WindSpeed"] == "wind_speed, km/h" and told["left"] == ["Gust"]
    assert "WindSpeed [wind_speed, km/h]" in (folder / "other" / "report.md").read_text()


@pytest.mark.slow
def test_a_map_of_rothermels_fuels_without_a_canopy_is_warned_of(folder, capsys):
    write(folder / "fuel.tif", np.full(SHAPE, 102), "int16", cell=50.0, crs="EPSG:32631", west=5e5)
    own = {"landscape.table": "fbfm40", "fire.model": "fbfm40", "fires": 1}
    assert main(arguments(folder, **own)) == 0
    assert "- warning: no canopy cover is read: the wind is that over open ground" in capsys.readouterr().out
    for name, value in (("cover", 70), ("height", 20), ("base_height", 1), ("bulk_density", 0.15)):
        plane = np.full(SHAPE, float(value))
        write(folder / f"{name}.tif", plane, "float32", cell=50.0, crs="EPSG:32631", west=5e5)
    crowns = {f"landscape.canopy_{name}": f"{name}.tif" for name in ("height", "base_height", "bulk_density")}
    units = {"landscape.canopy": "cover.tif", "landscape.height_unit": 1, "landscape.density_unit": 1}
    assert main(arguments(folder, **own, **crowns, **units, overwrite="true")) == 0
    assert "warning" not in capsys.readouterr().out
    share = read(folder / "out" / "crown.tif")
    assert np.nanmax(share) <= 1.0 and not np.isnan(share).all()


def test_a_window_is_predicted_on_its_own(folder):
    window = {"landscape.size": "[20,24]", "landscape.row": 10, "landscape.column": 2}
    assert main(arguments(folder, **window)) == 0
    with rasterio.open(folder / "out" / "rate.tif") as layer:
        assert layer.shape == (20, 24) and layer.transform.c == 5e5 + 100.0
    assert read(folder / "out" / "burn_probability.tif")[10, 8] == 1.0


@pytest.mark.slow
def test_an_ignition_may_be_a_raster(folder):
    cells = np.zeros(SHAPE)
    cells[20, 10] = 1
    lit = write(folder / "lit.tif", cells, "uint8", nodata=255, cell=50.0, crs="EPSG:32631", west=5e5)
    assert main(arguments(folder)) == 0 and main(arguments(folder, ignition=lit, out=folder / "other")) == 0
    one, other = (read(folder / name / "burn_probability.tif") for name in ("out", "other"))
    assert np.array_equal(one, other)


def test_ignitions_with_times_burn_from_then_on(folder):
    (folder / "later.csv").write_text("row,column,time\n20,10,2024-07-01 12:30\n30,30,2024-07-01 13:00\n")
    (folder / "hours.csv").write_text("row,column,hour\n30,30,1\n20,10,0.5\n")
    given = {"fires": 1, "ignition": folder / "later.csv"}
    assert main(arguments(folder, **given)) == 0
    assert main(arguments(folder, **{**given, "ignition": folder / "hours.csv"}, out=folder / "hours")) == 0
    assert main(arguments(folder, **given, start=15, out=folder / "before")) == 0
    one, same, before = (read(folder / name / "arrival_hours.tif") for name in ("out", "hours", "before"))
    assert one[20, 10] == 0.0 and one[30, 30] == pytest.approx(0.5, abs=1e-4) and np.nanmin(one[28:33, 28:33]) > 0.499
    assert np.array_equal(one, same, equal_nan=True)
    assert before[20, 10] == pytest.approx(0.25, abs=1e-4) and before[30, 30] == pytest.approx(0.75, abs=1e-4)
    report = json.loads((folder / "out" / "report.json").read_text())
    assert report["inputs"]["start [minutes after the first row]"] == 30.0
    assert report["inputs"]["ignition"].endswith("2 cells with fuel of 2")


def test_no_fire_crosses_a_barrier(folder):
    line = {"type": "LineString", "coordinates": [[5e5 + 1000.0, -100.0], [5e5 + 1000.0, 5e4]]}
    (folder / "road.geojson").write_text(json.dumps({**line, "crs": {"properties": {"name": "EPSG:32631"}}}))
    given = {"hours": 3, "fires": 2}
    assert main(arguments(folder, **given)) == 0
    assert main(arguments(folder, **given, barriers=folder / "road.geojson", out=folder / "road")) == 0
    free, held = (read(folder / name / "burn_probability.tif") for name in ("out", "road"))
    assert (free[:, 22:] > 0.0).any() and not (held[:, 20:] > 0.0).any() and (held[:, 10:19] > 0.0).any()
    report = json.loads((folder / "road" / "report.json").read_text())
    assert "cells that no fire enters" in report["inputs"]["barriers"]
    assert report["gigabytes"]["most"] >= report["gigabytes"]["program"] > 0.05 and report["at_once"] == 2


TIMES = {
    "ignition.path must have a time for each mark or for none": "row,column,time\n20,10,2024-07-01 12:10\n21,10,\n",
    "the time of an ignition must be a date and time": "row,column,time\n20,10,noon\n",
    "ignition.path must have a number of 0 or more for hour": "row,column,hour\n20,10,-1\n",
    "ignition must not be before the weather's first row": "row,column,time\n20,10,2024-07-01 11:50\n",
    "start must not be after the earliest ignition, 30 minutes": "row,column,minute\n20,10,30\n",
}


@pytest.mark.parametrize("line", TIMES)
def test_a_time_that_cannot_be_is_told_in_one_line(line, folder, capsys):
    (folder / "ignition.csv").write_text(TIMES[line])
    late = {"start": 45} if "start" in line else {}
    assert main(arguments(folder, **late)) == 2
    assert line in capsys.readouterr().err.strip().splitlines()[-1]


MISTAKES = {
    "barrier_width is read with barriers=FILE": {"barrier_width": 10},
    "hous is not a key of the configuration: did you mean hours?": {"hous": 3},
    "fire.cell_deviaton is not a key": {"fire.cell_deviaton": 0.2},
    "fires must be a whole number": {"fires": "many"},
    "fire must be a law of metres and minutes, rate, got Fire": {"fire": "paper", "fire.model": None},
    "fire.model must be that of landscape.table, fbp, got fbfm40": {"fire.model": "fbfm40"},
    "weather must be a CSV file that can be read": {"weather": "nowhere.csv"},
    "weather must name a CSV file of weather, got null": {"weather": "null"},
    "ignition.path must name a file that exists": {"ignition": "nowhere.csv"},
    "start must be a date and time as the first row has it, '2024-07-01 12:00'": {"start": "noon"},
    "landscape.row and landscape.column must be given": {"landscape.size": 20},
    "wind_height must be 10m or 20ft or null": {"wind_height": "2m"},
    "units must name a quantity (wind_speed, ": {"units.windsped": "km/h"},
    "units.WS must be m/s, km/h, mph, kt, got furlong": {"units.WS": "furlong"},
}


@pytest.mark.parametrize("line", MISTAKES)
def test_a_mistake_is_told_in_one_line_before_anything_is_written(line, folder, capsys):
    changes = arguments(folder, **MISTAKES[line])
    assert main([each for each in changes if not each.endswith("=None")]) == 2
    told = capsys.readouterr().err.strip().splitlines()[-1]
    assert line in told, told
    assert not (folder / "out").exists()


def test_a_folder_that_holds_something_is_left_alone(folder, capsys):
    assert main(arguments(folder)) == 0
    assert main(arguments(folder)) == 2
    assert "overwrite=true" in capsys.readouterr().err
    assert main(arguments(folder, overwrite="true")) == 0


def test_help_names_every_option(capsys):
    assert main(["--help"]) == 0
    said = capsys.readouterr().out
    ours = [name for name in compose_prediction([]) if name not in ("landscape", "fire")]
    assert all(f"\n  {name}=" in said or f"\n  {name}." in said for name in ours)


def test_a_configuration_shows_every_value():
    assert yaml.safe_dump(compose_prediction(["hours=3"])) and compose_prediction(["hours=3"])["hours"] == 3


@pytest.mark.skipif(not FIRES.is_dir(), reason=f"the shared fires are not at {FIRES}")
def test_a_real_fire_is_near_its_scar(tmp_path):
    fire = FIRES / "mica"
    more = {"hours": 24, "fires": 8, "out": tmp_path, "landscape.nodata": "unburnable"}
    layers = {"landscape.fuel": "fuel.asc", "landscape.elevation": "elevation.asc"}
    assert main(arguments(fire, **more, **layers)) == 0
    chance, scar = read(tmp_path / "burn_probability.tif") >= 0.5, read(fire / "scar.asc") > 0
    assert (chance & scar).sum() / (chance | scar).sum() > 0.8


def test_a_prediction_is_corrected_by_what_was_seen(folder, capsys):
    assert main(arguments(folder, fires=2, hours=2, perimeter_hours=0.5)) == 0
    seen = folder / "out" / "perimeters.geojson"
    shapes = json.loads(seen.read_text())
    shapes["features"] = shapes["features"][:2]
    (folder / "seen.geojson").write_text(json.dumps(shapes))
    out = folder / "corrected"
    given = {"observed": folder / "seen.geojson", "members.rate": 0.3, "hours": 2, "fires": 6, "out": out}
    capsys.readouterr()
    assert main(arguments(folder, **given)) == 0
    told, text = json.loads((out / "report.json").read_text())["observed"], capsys.readouterr().out
    assert [row["minutes"] for row in told["observations"]] == [30.0, 60.0] and told["members"] == 6
    assert told["observations"][1]["burned_ha"] == pytest.approx(shapes["features"][1]["properties"]["area_ha"])
    assert [(row["count"], row["to_minutes"]) for row in told["leads"]] == [(1, 30.0), (1, 60.0)]
    for line in ("| factor on all rates |", "| 30 to 60, 1 | Brier | 1.000 |", "| 1.00 | corrected |"):
        assert line in text
    assert (out / "observed.png").exists()
    lines = (out / "observed.csv").read_text().splitlines()
    assert len(lines) == 1 + 2 * 5 and lines[0].startswith("minutes,lead_minutes,kind,burned_ha,forecast,jaccard")
    chance, hours = read(out / "burn_probability.tif"), read(out / "arrival_hours.tif")
    assert (chance == 1.0).sum() * 0.25 >= told["observations"][1]["burned_ha"] and np.nanmax(hours) <= 1.0
    gusts = {"gusts": "true", "gustiness.factor": 2, "out": folder / "gusts"}
    assert main(arguments(folder, **{**given, **gusts})) == 0
    other = json.loads((folder / "gusts" / "report.json").read_text())["observed"]
    assert other["observations"][1]["posterior"] != told["observations"][1]["posterior"]


def test_the_times_of_every_fire_are_written_where_that_is_said(folder):
    assert main(arguments(folder, arrivals="true")) == 0
    with rasterio.open(folder / "out" / "arrivals.tif") as file:
        every, units, names = file.read(), set(file.units), file.descriptions
    assert len(every) > 1 and units == {"h"} and names[1] == "fire 1"
    came, chance = ~np.isnan(every), read(folder / "out" / "burn_probability.tif")
    assert came.mean(0) == pytest.approx(chance, abs=1e-5)
    with rasterio.open(folder / "out" / "arrival_hours.tif") as file:
        reached = came.any(0)
        assert np.nanmedian(every[:, reached], axis=0) == pytest.approx(file.read(1)[reached], abs=0.01)
        assert file.descriptions[-1] == "half" and set(file.units) == {"h"}


def test_fires_differ_in_their_rates_and_by_all_members_where_that_is_said(folder, capsys):
    given = {"rate": {}, "none": {"uncertain": "none"}, "all": {"uncertain": "all"}}
    unsure, areas = {}, {}
    for name, more in given.items():
        assert main(arguments(folder, **more, out=folder / name)) == 0
        chance = read(folder / name / "burn_probability.tif")
        unsure[name] = int(((chance > 0.0) & (chance < 1.0)).sum())
        areas[name] = json.loads((folder / name / "report.json").read_text())["area_ha"]
    assert min(unsure["all"], unsure["rate"]) > 1.2 * unsure["none"]
    assert areas["rate"]["low"] < 0.8 * areas["none"]["median"] < areas["rate"]["high"]
    for more, line in (
        ({"members.bearing": 30}, "members but members.rate is read with uncertain=all or observed=FILE"),
        ({"members.rate": 0.3, "uncertain": "none"}, "members is read with uncertain=all or observed=FILE"),
    ):
        assert main(arguments(folder, **more, out=folder / "no")) == 2
        assert line in capsys.readouterr().err


def test_a_single_fire_is_that_of_the_law(folder):
    for name, more in {"one": {}, "same": {"uncertain": "none"}}.items():
        assert main(arguments(folder, fires=1, out=folder / name, **more)) == 0
    one, same = (read(folder / name / "arrival_hours.tif") for name in ("one", "same"))
    assert np.array_equal(one, same, equal_nan=True)
    one, same = (json.loads((folder / name / "report.json").read_text())["area_ha"] for name in ("one", "same"))
    assert one == same


def test_what_cannot_be_read_as_seen_is_one_line_and_nothing_is_written(folder, capsys):
    (folder / "seen.csv").write_text("latitude,longitude,acq_date,acq_time\n0.0,3.0,2024-07-01,1300\n")
    assert main(arguments(folder, observed=folder / "seen.csv")) == 2 and not (folder / "out").exists()
    line = capsys.readouterr().err.strip().splitlines()[-1]
    assert "the time of what is observed must have no offset where the rows have none" in line


def test_weather_is_a_folder_of_rasters_whose_wind_differs_by_place(folder):
    # East of the fire the wind comes from the east, west of it from the west: it goes to neither side far.
    bearing = np.where(np.arange(5.0) < 2.0, 270.0, 90.0) * np.ones((4, 1))
    place = {"cell": 500.0, "crs": "EPSG:32631", "west": 5e5}
    write(folder / "w_wd.tif", bearing, **place)
    write(folder / "w_ws.tif", np.full((4, 5), 12.0), **place)
    (folder / "ignition.csv").write_text("row,column\n20,20\n")
    given = {"units.wind_speed": "km/h", "fires": 1}
    assert main(arguments(folder, **given)) == 0
    assert main(arguments(folder, weather=folder, **given, out=folder / "other")) == 0
    straight, held = (np.isfinite(read(folder / out / "arrival_hours.tif")) for out in ("out", "other"))
    assert straight[20, 30] and not held[20, 30]
    told = json.loads((folder / "other" / "report.json").read_text())
    assert [each["file"].rpartition("/")[2] for each in told["files"]][-2:] == ["w_wd.tif", "w_ws.tif"]


def test_sun_and_shade_are_computed_with_weather_by_place_and_rasters_of_dead_fuel_are_refused(folder, capsys):
    place = {"cell": 500.0, "crs": "EPSG:32631", "west": 5e5}
    write(folder / "w_wd.tif", np.full((4, 5), 270.0), **place)
    write(folder / "w_ws.tif", np.full((4, 5), 3.0), **place)
    write(folder / "fuel.tif", np.full(SHAPE, 102), "int16", cell=50.0, crs="EPSG:32631", west=5e5)
    height = 30.0 * np.abs(np.arange(40.0) - 20.0)[:, None] * np.ones(44)  # downhill: the south above, the north below
    write(folder / "elevation.tif", height, cell=50.0, crs="EPSG:32631", west=5e5)
    (folder / "weather.csv").write_text("datetime,temp [C],RH,WS [m/s],WD\n2024-08-01 14:00,29.4,22,3,270\n")
    (folder / "ignition.csv").write_text("row,column\n20,20\n")
    given = {"weather": folder, "units.wind_speed": "m/s", "fires": 1, "hours": 3, "moisture": "fosberg"}
    rothermel = {"landscape.table": "fbfm40", "fire.model": "fbfm40", "fire.slope_gain": 0, "fire.cell_deviation": 0}
    assert main(arguments(folder, **given, **rothermel)) == 0
    rate = read(folder / "out" / "rate.tif")
    assert rate[17, 22] > 1.05 * rate[23, 22], "south slopes are drier by 2 %"
    write(folder / "w_m1.tif", np.full((4, 5), 6.0), **place)
    assert main(arguments(folder, **given, **rothermel, out=folder / "other")) == 2
    assert "which rasters of the weather give by place" in capsys.readouterr().err


def test_wind_is_bent_by_hills_where_that_is_asked(folder):
    height = np.zeros(SHAPE)
    height[:, 24:30] = 150.0  # a ridge across the wind
    write(folder / "elevation.tif", height, cell=50.0, crs="EPSG:32631", west=5e5)
    for wind in ("weather", "terrain"):
        assert main(arguments(folder, wind=wind, **{"hills.layers": 6}, fires=1, hours=2, out=folder / wind)) == 0
    plain, bent = (read(folder / wind / "rate.tif")[20] for wind in ("weather", "terrain"))
    assert bent[26] > 1.1 * plain[26], "faster on top"
    told = json.loads((folder / "terrain" / "report.json").read_text())
    assert told["configuration"]["wind"] == "terrain" and told["configuration"]["hills"]["layers"] == 6


@pytest.mark.slow
def test_gusts_and_acceleration_act_and_the_column_of_gusts_is_read_for_them(folder):
    rows = "\n".join(f"2024-07-01 {hour}:00,10.8,270,90,{gust}" for hour, gust in ((12, 20), (13, "")))
    (folder / "gusts.csv").write_text(f"datetime,WS,WD,FFMC,Gust\n{rows}\n")
    given = {"weather": folder / "gusts.csv", "fires": 1, "fire.curing": 95}
    told = []
    for number, each in enumerate(({}, {"gusts": "true", "fire.acceleration": "true"})):
        assert main(arguments(folder, **given, **each, out=folder / f"out{number}")) == 0
        told.append(json.loads((folder / f"out{number}" / "report.json").read_text()))
    plain, young = (each["by_hour"][-1]["area_ha"]["median"] for each in told)
    assert young < 0.9 * plain
    read = [next(each for each in one["files"] if each["key"] == "weather")["read"] for one in told]
    assert "Gust" not in read[0] and read[1]["Gust"] == "wind_gust, km/h"


@pytest.mark.parametrize(
    "changes, why",
    [
        ({"moisture": "fosberg"}, "moisture=fosberg is read by Rothermel's fuels"),
        ({"season": "date"}, "season=date knows Canada and Alaska in Canadian fuel, got 0.4"),
        ({"gusts": "true"}, "gusts needs a column of gusts in the weather, or gustiness.factor"),
        ({"gustiness.factor": 1.5}, "gustiness is read with gusts=true"),
        ({"gusts": "true", "observed": "seen.geojson"}, "gusts needs a column of gusts in the weather"),
        ({"weather": "none.nc"}, "weather must be"),
    ],
)
def test_options_of_the_air_that_do_not_fit_are_refused(folder, capsys, changes, why):
    assert main(arguments(folder, **changes)) == 2
    assert why in capsys.readouterr().err and not (folder / "out" / "report.json").exists()
