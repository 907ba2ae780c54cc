"""The command, from files to tables and a card."""

import json
import sys
from importlib.util import find_spec

import numpy as np
import pytest
import torch

from warp_torchrl.commands.score import main
from warp_torchrl.prediction.scores.seen import Reading, read_seen
from warp_torchrl.world.terrain.geotiff import local_grid, write_geotiff

pytest.importorskip("rasterio", reason="rasters need the extra gis")
SIZE = (12, 16)
DAY = "2024-07-01"


@pytest.fixture(autouse=True)
def _figures(request):
    is_drawn = request.node.name == "test_an_ensemble_is_scored_at_each_perimeter"
    if not is_drawn and find_spec("matplotlib") is not None:
        request.getfixturevalue("blank_figures")


@pytest.fixture
def fire(tmp_path):
    """A fire that moves a column in half an hour: an ensemble of three, and what was seen of it."""
    grid, column = local_grid(SIZE, 100.0), torch.arange(16.0).expand(SIZE)
    bands = {f"fire {each}": column * 0.5 * pace for each, pace in enumerate((1.0, 2.0, 0.5))}
    write_geotiff(tmp_path / "arrivals.tif", bands, grid, unit="h")
    write_geotiff(tmp_path / "bare.tif", {"times": column * 30.0}, grid)
    write_geotiff(tmp_path / "scar.tif", {"scar": (column <= 4).to(torch.uint8)}, grid)
    write_geotiff(tmp_path / "seen_arrival.tif", {"arrival": column * 20.0}, grid, unit="min")
    write_geotiff(tmp_path / "chance.tif", {"chance": (column <= 4) * 0.8}, grid)
    write_geotiff(tmp_path / "fuel.tif", {"fuel": torch.full(SIZE, 101, dtype=torch.int16)}, grid)
    (tmp_path / "ignition.csv").write_text("row,column\n6,0\n")
    (tmp_path / "weather.csv").write_text(
        f"datetime,WS,WD\n{DAY} 12:00,20,270\n{DAY} 13:00,20,270\n{DAY} 14:00,20,270\n"
    )
    boxes = [
        {"type": "Feature", "properties": {"datetime": f"{DAY} {12 + hour}:00"}, "geometry": box(200.0 * hour + 100.0)}
        for hour in (1, 2)
    ]
    seen = {"type": "FeatureCollection", "crs": None, "features": boxes}
    (tmp_path / "seen.geojson").write_text(json.dumps(seen))
    return tmp_path


def box(east):
    return {"type": "Polygon", "coordinates": [[[0, 0], [east, 0], [east, 1200], [0, 1200], [0, 0]]]}


def scored(folder, *given):
    assert main([*given, f"out={folder / 'out'}", "overwrite=true"]) == 0
    return json.loads((folder / "out" / "scores.json").read_text())


def test_a_missing_rasterio_is_told_of_the_key_that_needs_it(fire, capsys, monkeypatch):
    monkeypatch.setitem(sys.modules, "rasterio", None)
    assert main([f"arrival={fire}/arrivals.tif", f"observed={fire}/seen.geojson", f"out={fire / 'out'}"]) == 2
    last = capsys.readouterr().err.splitlines()[-1]
    assert last == 'error: arrival must be read with rasterio, which is missing: pip install "warp_torchrl[gis]"'


def test_an_ensemble_is_scored_at_each_perimeter(fire, capsys):
    more = [f"ignition={fire}/ignition.csv", f"fuel={fire}/fuel.tif", f"weather={fire}/weather.csv", "title=drawn"]
    found = scored(fire, f"arrival={fire}/arrivals.tif", f"observed={fire}/seen.geojson", f"start='{DAY} 12:00'", *more)
    assert [row["minutes"] for row in found["observations"]] == [60.0, 120.0]
    last = found["observations"][-1]
    assert last["seen_ha"] == 12 * 5 and last["forecast"]["jaccard"] == 1.0, "the middle fire has columns 0 to 4"
    assert last["areas"]["holds"] and last["forecast"]["growth_jaccard"] == 1.0
    assert set(found["at_area"]) == {"predicted", "circle", "ellipse", "walking ellipse"}
    assert found["arrival"]["bias"] == pytest.approx(15.0), "columns 3 and 4 at 90 and 120 minutes, seen at 75 and 105"
    page = (fire / "out" / "scores.md").read_text()
    assert "# Scores: drawn" in page and page.strip() in capsys.readouterr().out
    assert (fire / "out" / "card.png").stat().st_size > 10_000


def test_one_fire_is_scored_against_rasters_and_several_files(fire):
    given = [
        f"arrival={fire}/bare.tif",
        "unit=minutes",
        f"observed=[{fire}/seen_arrival.tif,{fire}/scar.tif]",
        "hours=2",
    ]
    found = scored(fire, *given)
    kinds = [row["kind"] for row in found["observations"]]
    assert kinds == ["arrival", "arrival", "scar", "arrival", "arrival", "arrival"]
    assert found["observations"][2]["forecast"]["brier"] is None, "nothing burned since the observation before"
    # Column c burned at 20 c minutes, and 30 c were predicted; by hour 5 the columns 0 to 10 of both
    assert found["arrival"]["bias"] == pytest.approx(10.0 * np.mean(range(11)))


def test_a_map_of_probability_is_scored_at_the_end(fire):
    found = scored(fire, f"probability={fire}/chance.tif", f"observed={fire}/scar.tif")
    (only,) = found["observations"]
    assert only["minutes"] is None and only["forecast"]["brier"] == pytest.approx(0.04)
    assert found["configuration"]["probability"] == f"{fire}/chance.tif"


def test_a_prediction_s_folder_is_read_by_its_half_of_the_fires(fire):
    grid, column = local_grid(SIZE, 100.0), torch.arange(16.0).expand(SIZE)
    (fire / "prediction").mkdir()
    bands = {"median": column * 9.0, "half": column * 0.5}
    write_geotiff(fire / "prediction" / "arrival_hours.tif", bands, grid, unit="h")
    found = scored(fire, f"arrival={fire}/prediction", f"observed={fire}/scar.tif", "hours=2")
    assert found["observations"][0]["forecast"]["jaccard"] == 1.0 and found["observations"][0]["areas"] is None


def test_what_was_seen_after_the_prediction_s_end_is_left_out(fire):
    (fire / "prediction").mkdir()
    (fire / "arrivals.tif").rename(fire / "prediction" / "arrivals.tif")
    (fire / "prediction" / "report.json").write_text('{"followed_minutes": {"high": 90.0}}')
    given = [f"arrival={fire}/prediction", f"observed={fire}/seen.geojson", f"start='{DAY} 12:00'"]
    assert [row["minutes"] for row in scored(fire, *given)["observations"]] == [60.0]
    assert len(scored(fire, *given, "until=3")["observations"]) == 2


@pytest.mark.parametrize(
    ("given", "line"),
    [
        ([], "arrival or probability must name a raster of a predicted fire, got neither"),
        (["arrival=a.tif"], "observed must name a file of what burned, got none"),
        (
            ["arrival={0}/bare.tif", "observed={0}/scar.tif"],
            "unit must be minutes or hours, as {0}/bare.tif states none",
        ),
        (
            ["arrival={0}/arrivals.tif", "observed={0}/none.tif"],
            "observed must name files that exist, got {0}/none",
        ),
        (["arrival={0}", "observed={0}/scar.tif", "fuel=a.tif"], "ignition must be given with fuel"),
        (["arrival={0}/arrivals.tif", "observed={0}/seen.geojson"], "start must be a date and time like those of what"),
        (["arrival=a", "observd=b"], "observd is not a key of warp score"),
        (["arrival={0}/out", "observed={0}/scar.tif"], "arrival must be a raster, or a folder with arrivals.tif or"),
    ],
)
def test_a_refusal_is_one_line(fire, given, line, capsys):
    (fire / "out").mkdir()
    assert main([each.format(fire) for each in given]) == 2
    assert line.format(fire) in capsys.readouterr().err.strip().splitlines()[-1]


def test_what_burned_stays_burned_in_other_files_too(fire):
    path, grid = fire / "early.geojson", local_grid(SIZE, 100.0)
    feature = {"type": "Feature", "properties": {"hours": 1}, "geometry": box(700.0)}
    path.write_text(json.dumps({"type": "FeatureCollection", "crs": None, "features": [feature]}))
    found, times = read_seen([f"{fire}/scar.tif", str(path)], grid, Reading(moment=float))
    assert [each.kind for each in found] == ["perimeter", "scar"] and times is None
    assert [int(each.burned.sum()) for each in found] == [84, 84], "the scar alone has 60 cells"
