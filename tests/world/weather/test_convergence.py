"""Grid north and true north."""

import math
import sys

import pytest

from warp_torchrl.world.weather.convergence import grid_convergence

rasterio = pytest.importorskip("rasterio", reason="the extra gis is not installed")


def place(crs, longitude, latitude):
    from rasterio.warp import transform

    (x,), (y,) = transform("EPSG:4326", crs, [longitude], [latitude])
    return crs, x, y


def test_vermont_on_the_albers_grid_of_the_states_is_turned_by_fourteen_degrees():
    # An equal-area cone turns by n per degree from its central meridian, n = (sin 29.5 + sin 45.5) / 2 = 0.6029:
    # 0.6029 (96 - 72.7) = 14.05, and grid north lies clockwise of true north
    assert grid_convergence(*place("EPSG:5070", -72.7, 44.0)) == pytest.approx(14.05, abs=0.02)
    assert grid_convergence(*place("EPSG:5070", -120.0, 44.0)) == pytest.approx(-14.47, abs=0.02)


def test_a_utm_zone_turns_towards_its_edges():
    # Zone 18 is centred on 75 W; at its east edge atan(tan 3 sin 44) = 2.085
    told = math.degrees(math.atan(math.tan(math.radians(3)) * math.sin(math.radians(44))))
    assert grid_convergence(*place("EPSG:32618", -72.0, 44.0)) == pytest.approx(told, abs=1e-3)
    assert grid_convergence(*place("EPSG:32618", -75.0, 44.0)) == pytest.approx(0, abs=1e-6)


def test_a_bearing_from_true_north_turns_into_one_of_the_grid():
    # A step to true north from a place in Vermont is a step along this bearing of the grid
    crs, x, y = place("EPSG:5070", -72.7, 44.0)
    _, x1, y1 = place("EPSG:5070", -72.7, 44.1)
    assert math.degrees(math.atan2(x1 - x, y1 - y)) == pytest.approx(0 - grid_convergence(crs, x, y), abs=1e-3)


def test_maps_in_degrees_are_not_turned():
    assert grid_convergence("EPSG:4326", -72.7, 44.0) == pytest.approx(0, abs=1e-9)


@pytest.mark.parametrize(("crs", "x"), [("EPSG:999999", 0.0), ("nonsense", 0.0), ("EPSG:5070", math.inf)])
def test_what_has_no_north_is_refused(crs, x):
    with pytest.raises(ValueError, match=r"^crs must be a system that knows the place"):
        grid_convergence(crs, x, 0.0)


def test_a_missing_rasterio_is_told(monkeypatch):
    monkeypatch.setitem(sys.modules, "rasterio.warp", None)
    with pytest.raises(ValueError, match=r'pip install "warp_torchrl\[gis\]"'):
        grid_convergence("EPSG:5070", 0.0, 0.0)
