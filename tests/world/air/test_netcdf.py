"""Weather from netCDF files as ERA5, HRRR and the CF conventions have them."""

import builtins

import numpy as np
import pytest
import torch

from tests.world.rasters import rasterio, write
from warp_torchrl.world.air.folder import read_folder
from warp_torchrl.world.air.netcdf import netcdf_minutes, read_netcdf
from warp_torchrl.world.air.options import WeatherOptions
from warp_torchrl.world.air.sunlight import by_sunlight
from warp_torchrl.world.behaviour.moistures import MOISTURES
from warp_torchrl.world.state.window import Window
from warp_torchrl.world.terrain.crs import project, stated_crs
from warp_torchrl.world.terrain.layer import read_grid
from warp_torchrl.world.weather.dead_moisture import dead_moisture
from warp_torchrl.world.weather.fwi import hourly_ffmc
from warp_torchrl.world.weather.reanalysis import humidity_of

xarray = pytest.importorskip("xarray")
pytest.importorskip("netCDF4")

MAP = Window.whole((12, 16))
TIMES = np.array(["2024-07-01T12:00", "2024-07-01T13:00"], "datetime64[ns]")
LAMBERT = {
    "grid_mapping_name": "lambert_conformal_conic",
    "standard_parallel": [49.0, 49.0],
    "longitude_of_central_meridian": 5.0,
    "latitude_of_projection_origin": 49.0,
    "earth_radius": 6371229.0,
}


def utm(cell, west=5e5, north=5.5e6):
    return {"cell": None, "crs": "EPSG:32631", "transform": rasterio.Affine(cell, 0.0, west, 0.0, -cell, north)}


@pytest.fixture
def grid(tmp_path):
    """A map of 12 x 16 cells of 50 m in UTM 31, at 3 degrees east."""
    write(tmp_path / "fuel.tif", np.ones((12, 16)), **utm(50.0))
    return read_grid("fuel", tmp_path / "fuel.tif")


def degrees(path, longitude=None, **variables):
    """Write fields by the hour on a grid of 0.25 degrees about the map; the southern row comes first."""
    latitude = np.arange(49.0, 50.6, 0.25)
    longitude = np.arange(2.0, 4.1, 0.25) if longitude is None else longitude
    shape = (2, len(latitude), len(longitude))
    held = {
        name: (("valid_time", "latitude", "longitude"), np.broadcast_to(np.asarray(value, float), shape), told)
        for name, (value, told) in variables.items()
    }
    places = {"valid_time": TIMES, "latitude": latitude, "longitude": longitude}
    xarray.Dataset(held, coords=places).to_netcdf(path)
    return path


ERA5 = {
    "u10": (3.0, {"units": "m s**-1"}),
    "v10": (np.array([4.0, -4.0])[:, None, None], {"units": "m s**-1"}),
    "t2m": (303.15, {"units": "K"}),
    "d2m": (283.15, {"units": "K"}),
    "tp": (0.0, {"units": "m"}),
}


def test_era5_gives_wind_moistures_and_times(tmp_path, grid):
    table, fields = read_netcdf(degrees(tmp_path / "era5.nc", **ERA5), grid)
    assert table.hours.tolist() == [0.0, 1.0] and table.zone == 0.0 and table.began == 19905 * 24.0 + 12.0
    torch.testing.assert_close(fields.wind[0, :, 0, 0], torch.tensor([3.0, 4.0]))
    assert table.wind_speed.tolist() == pytest.approx([5.0, 5.0])
    assert table.wind_bearing.tolist() == pytest.approx([216.87, 323.13], abs=0.01)  # from the south-west, north-west
    humidity = humidity_of([30.0], [10.0])
    dead = dead_moisture(torch.tensor([30.0]), torch.tensor(humidity))
    assert table.dead_1h[0] == pytest.approx(float(dead[0]), rel=1e-4)
    code = torch.tensor(85.0)
    for _ in range(2):
        code = hourly_ffmc(code, *(torch.tensor(each) for each in (30.0, humidity[0], 5.0, 0.0)))
    assert table.ffmc[1] == pytest.approx(float(code), rel=1e-4)
    assert table.live_woody is None and bool(fields.moisture[:, list(MOISTURES).index("bui")].isnan().all())


def test_fosbergs_tables_take_the_air_by_place(tmp_path, grid):
    # 86 F and 29 %: reference 4; in July at noon, at 3 degrees east, 0 more on level ground. Then it rains.
    told = {**ERA5, "tp": (np.array([0.0, 0.001])[:, None, None], {"units": "m"})}
    table, fields, sunlight = by_sunlight(*read_netcdf(degrees(tmp_path / "a.nc", **told), grid), longitude=3.0)
    assert fields.air[0, :, 0, 0].tolist() == pytest.approx([30.0, 28.93, 0.0], abs=0.01)
    assert fields.moisture[0, :3, 0, 0].tolist() == [4.0, 5.0, 6.0] and table.dead_1h.tolist() == [4.0, 35.0]
    assert sunlight[0].dry.all() and not sunlight[1].dry.any()


def test_longitudes_to_360_and_rows_from_the_south_lie_where_they_are(tmp_path, grid):
    rising = np.arange(49.0, 50.6, 0.25)[:, None] * np.ones(9)  # wind of the latitude, in tenths
    told = {"u10": (rising / 10.0, {"units": "m/s"}), "v10": (0.0, {"units": "m/s"})}
    table, _ = read_netcdf(degrees(tmp_path / "a.nc", longitude=np.arange(362.0, 364.1, 0.25), **told), grid)
    assert table.wind_speed[0] == pytest.approx(4.965, abs=0.003)  # 5,500,000 m north is 49.65 degrees


@pytest.mark.parametrize("cell, west, north", [(200.0, 5e5, 5.5e6), (2000.0, 5e5 - 2600.0, 5.5e6 + 2600.0)])
def test_a_projected_file_is_as_a_folder_of_rasters_on_its_grid(tmp_path, grid, cell, west, north):
    east = np.arange(4.0) * np.ones((3, 1))
    stacked = np.stack((4.0 + east, 8.0 - east), axis=2)
    for name, values in (("u", stacked), ("v", -stacked)):
        write(tmp_path / f"{name}.tif", values, **utm(cell, west, north))
    x, y = west + cell * (0.5 + np.arange(4)), north - cell * (0.5 + np.arange(3))
    fields = {
        name: (("time", "y", "x"), sign * stacked.transpose(2, 0, 1), {"units": "m/s", "grid_mapping": "crs"})
        for name, sign in (("u10", 1.0), ("v10", -1.0))
    }
    mapping = {"grid_mapping_name": "transverse_mercator", "crs_wkt": stated_crs("map", "EPSG:32631").to_wkt()}
    told = xarray.Dataset({**fields, "crs": ((), 0, mapping)}, coords={"time": TIMES, "x": x / 1000.0, "y": y / 1000.0})
    for axis in "xy":
        told[axis].attrs = {"units": "km", "standard_name": f"projection_{axis}_coordinate"}
    told.to_netcdf(tmp_path / "wind.nc")
    one = read_netcdf(tmp_path / "wind.nc", grid)
    other = read_folder(tmp_path, grid, WeatherOptions(units={"wind_speed": "m/s"}))
    winds = [found.fields.at(1).here(found.fields.means[0][1:], torch.ones(1, 7), MAP)[0] for found in (one, other)]
    torch.testing.assert_close(*winds, atol=1e-4, rtol=0)
    assert one.table.wind_bearing.tolist() == pytest.approx(other.table.wind_bearing.tolist())


def test_winds_of_a_weather_models_rows_are_turned_to_north_and_places_by_cell_are_found(tmp_path, grid):
    lambert = stated_crs("model", _wkt())
    (x,), (y,) = project("map", np.array([5e5]), np.array([5.5e6]), grid.crs, lambert)
    xs, ys = x + 3000.0 * np.arange(-3, 4), y + 3000.0 * np.arange(-3, 4)
    longitude, latitude = project(
        "map", *(each.ravel() for each in np.meshgrid(xs, ys)), lambert, stated_crs("", "EPSG:4326")
    )
    planes = {
        name: (("y", "x"), each.reshape(7, 7))
        for name, each in (("longitude", longitude % 360), ("latitude", latitude))
    }
    told = {"units": "m s-1", "grid_mapping": "model", "GRIB_uvRelativeToGrid": 1}
    wind = {name: (("time", "y", "x"), np.full((1, 7, 7), value), told) for name, value in (("u10", 0.0), ("v10", 5.0))}
    made = xarray.Dataset({**wind, "model": ((), 0, LAMBERT)}, coords={"time": TIMES[:1], **planes})
    made.to_netcdf(tmp_path / "hrrr.nc")
    table, _ = read_netcdf(tmp_path / "hrrr.nc", grid)
    # 2 degrees west of the central meridian the grid's north is sin(49) 2 = 1.51 degrees left of true north.
    assert table.wind_bearing[0] == pytest.approx(180.0 - 1.51, abs=0.02)
    assert table.wind_speed[0] == pytest.approx(5.0)


def _wkt():
    from warp_torchrl.world.air.netcdf_grid import _wkt as wkt

    return wkt("lambert_conformal_conic", LAMBERT)


def test_a_moment_is_in_utc_or_has_an_offset(tmp_path, grid):
    path = degrees(tmp_path / "era5.nc", **ERA5)
    assert netcdf_minutes("2024-07-01 12:30", path) == 30.0 and netcdf_minutes("2024-07-01T06:00-07:00", path) == 60.0


@pytest.mark.parametrize(
    "changes, why",
    [
        ({"u10": (3.0, {"units": "furlongs"})}, "u10 must name its unit"),
        ({"u10": (300.0, {"units": "m/s"})}, r"u10 must be in \[-100, 100\] m/s, got 300"),
        ({"v10": None}, "the file must have wind, as u10 and v10"),
        ({"10u": (3.0, {"units": "m/s"})}, "one variable of wind_u, got u10 and 10u"),
    ],
)
def test_what_does_not_fit_is_refused_in_one_line_with_the_file(tmp_path, grid, changes, why):
    told = {name: each for name, each in {**ERA5, **changes}.items() if each is not None}
    with pytest.raises(ValueError, match=why) as raised:
        read_netcdf(degrees(tmp_path / "bad.nc", **told), grid)
    assert str(raised.value).startswith(str(tmp_path / "bad.nc")) and "\n" not in str(raised.value)


def test_files_elsewhere_damaged_or_missing_are_refused(tmp_path, grid):
    far = degrees(tmp_path / "far.nc", longitude=np.arange(20.0, 22.1, 0.25), **ERA5)
    (tmp_path / "no.nc").write_text("no netCDF")
    for path, why in (
        (far, "must cover the map"),
        (tmp_path / "no.nc", "netCDF file"),
        (tmp_path / "gone.nc", "exists"),
    ):
        with pytest.raises(ValueError, match=why):
            read_netcdf(path, grid)


def test_without_the_extra_one_line_says_what_to_install(tmp_path, grid, monkeypatch):
    path, real = degrees(tmp_path / "era5.nc", **ERA5), builtins.__import__

    def without(name, *rest, **more):
        if name == "xarray":
            raise ImportError(name)
        return real(name, *rest, **more)

    monkeypatch.setattr(builtins, "__import__", without)
    with pytest.raises(ValueError, match=r'pip install "warp_torchrl\[netcdf\]"'):
        read_netcdf(path, grid)
