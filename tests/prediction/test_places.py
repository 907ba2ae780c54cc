"""Predictions in metres of the ground, and what their report says of the files of the map."""

import json
from types import SimpleNamespace

import numpy as np
import pytest

from tests.world.rasters import rasterio
from warp_torchrl.commands.predict import main
from warp_torchrl.prediction.case import _check_cell_size

warp = pytest.importorskip("rasterio.warp")
SIDE = 61


@pytest.fixture
def folder(tmp_path):
    """Even grass about 121 W, 50 N in Web Mercator, lit in the middle, as a landscape of several bands."""
    (x,), (y,) = warp.transform("EPSG:4326", "EPSG:3857", [-121.0], [50.0])
    place = rasterio.Affine(30.0, 0.0, x - 30.0 * SIDE / 2, 0.0, -30.0, y + 30.0 * SIDE / 2)
    bands = {"Elevation": 700, "Slope": 0, "Fuel Model": 102}
    profile = {"driver": "GTiff", "height": SIDE, "width": SIDE, "count": len(bands), "dtype": "int16"}
    with rasterio.open(tmp_path / "land.tif", "w", crs="EPSG:3857", transform=place, **profile) as file:
        for number, (name, value) in enumerate(bands.items(), start=1):
            file.write(np.full((SIDE, SIDE), value, "int16"), number)
            file.set_band_description(number, name)
    (tmp_path / "other.asc").write_text("")
    (tmp_path / "start.geojson").write_text(json.dumps({"type": "Point", "coordinates": [-121.0, 50.0]}))
    (tmp_path / "weather.csv").write_text("datetime,WS,WD,TMP,RH,APCP\n2024-07-01 12:00,5,270,28,30,0\n")
    return tmp_path


def predicted(folder, **changes):
    """Return the exit code, and the report where there is one."""
    given = {"landscape.path": folder, "landscape.fuel": "land.tif", "landscape.elevation": "land.tif", "hours": 0.5}
    given |= {"landscape.table": "fbfm40", "landscape.nodata": "unburnable", "ignition": folder / "start.geojson"}
    given |= {"weather": folder / "weather.csv", "out": folder / "out", "fires": 1, "fire.cell_deviation": 0}
    code = main([f"{key}={value}" for key, value in {**given, **changes}.items()])
    path = folder / "out" / "report.json"
    return code, json.loads(path.read_text()) if path.exists() else None


def test_a_map_in_web_mercator_is_refused_and_burns_on_the_ground_once_resampled(folder, capsys):
    assert predicted(folder) == (2, None)
    assert "cells of 19.29 m there, and 30 m on the map; give resolution=30" in capsys.readouterr().err
    onto = {"landscape.resolution": 10, "landscape.resample": "mode"}
    code, report = predicted(folder, **onto)
    assert code == 0 and report["inputs"]["crs"] == "EPSG:32610"
    shapes = json.loads((folder / "out" / "perimeters.geojson").read_text())["features"]
    equal_area = warp.transform_geom("EPSG:4326", "EPSG:6933", shapes[-1]["geometry"], precision=6)
    ring = np.array(max((polygon[0] for polygon in equal_area["coordinates"]), key=len))
    area = abs((ring[:-1, 0] * ring[1:, 1] - ring[1:, 0] * ring[:-1, 1]).sum()) / 2e4
    assert report["area_ha"]["median"] == pytest.approx(area, rel=0.01)
    files = report["inputs"]
    assert files["fuel"] == "land.tif, band Fuel Model [codes of fbfm40]"
    assert files["elevation"] == "land.tif, band Elevation [m]"
    assert files["bands of land.tif that are not read"] == "Slope"
    assert files["files that are not read"] == "other.asc"
    assert files["cells of fuels"].startswith("102 (")


def test_a_cell_size_that_is_not_the_map_s_is_refused(folder, capsys):
    onto = {"landscape.resolution": 20, "landscape.resample": "mode"}
    assert predicted(folder, cell_size=30, **onto) == (2, None)
    assert "cell_size must be that of the landscape, 20 m, or null, got 30" in capsys.readouterr().err
    grid = SimpleNamespace(is_on_earth=True, is_placed=True, cell_size=20.0)
    for rounded in (None, 19.92, 20.0, 20.08):  # by less than half a per cent
        _check_cell_size(rounded, grid)
