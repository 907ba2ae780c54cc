"""Weather from a folder of rasters: names, units, hours, and wind by place."""

import math

import numpy as np
import pytest
import torch

from tests.world.rasters import write
from warp_torchrl.world.air.fields import Field, Lattice
from warp_torchrl.world.air.folder import read_folder
from warp_torchrl.world.air.options import WeatherOptions
from warp_torchrl.world.air.points import window_of
from warp_torchrl.world.behaviour.moistures import MOISTURES
from warp_torchrl.world.state.window import Window
from warp_torchrl.world.terrain.layer import read_grid

CRS = {"crs": "EPSG:32631", "west": 5e5}
MAP = Window.whole((12, 16))
UNIT = {"wind_speed": "m/s"}


@pytest.fixture
def folder(tmp_path):
    """A map of 12 x 16 cells of 50 m, and weather of two hours on cells of 200 m."""
    write(tmp_path / "fuel.tif", np.ones((12, 16)), cell=50.0, **CRS)
    east = np.arange(4.0) * np.ones((3, 1))  # 0 .. 3 from the west to the east
    coarse = {"cell": 200.0, **CRS}
    write(tmp_path / "a_ws.tif", np.stack((4.0 + east, 8.0 + 0 * east), axis=2), **coarse)
    write(tmp_path / "a_wd.tif", np.stack((270.0 + 0 * east, 350.0 + 20.0 * (east > 1)), axis=2), **coarse)
    write(tmp_path / "a_m1.tif", np.stack((4.0 + east, 9.0 + 0 * east), axis=2), **coarse)
    return tmp_path


def read(folder, corner=(0, 0), size=None, **options):
    window = window_of(read_grid("fuel", folder / "fuel.tif"), corner, size)
    return read_folder(folder, window, WeatherOptions(**{"units": UNIT, **options}))


def here(found, row):
    """Return the wind [2, H, W] and the moisture [H, W, 7] of an hour on the map."""
    winds, moistures = found.fields.means
    moistures = torch.where(moistures.isnan(), torch.tensor([*MOISTURES.values()]), moistures)
    wind, moisture = found.fields.at(row).here(winds[row : row + 1], moistures[row : row + 1], MAP)
    return wind[0], moisture[0]


def test_wind_and_moisture_are_interpolated_between_the_middles_of_the_cells(folder):
    (u, v), moisture = here(read(folder), 0)
    # Middles lie at columns 1.5, 5.5, 9.5 and 13.5 of the map: column 3 is 3 / 8 of the way from the first to the next.
    expected = torch.tensor([4.0, 4.375, 5.5, 7.0])
    torch.testing.assert_close(u[5, [0, 3, 7, 15]] + 0 * expected, torch.tensor([4.0, 4.375, 5.375, 7.0]))
    torch.testing.assert_close(v, torch.zeros_like(v), atol=1e-5, rtol=0)
    torch.testing.assert_close(moisture[5, [0, 3, 7, 15], 0], torch.tensor([4.0, 4.375, 5.375, 7.0]))
    assert (moisture[..., 3] == MOISTURES["live_herbaceous"]).all()


def test_bearings_on_both_sides_of_north_meet_there_and_not_in_the_south(folder):
    (u, v), _ = here(read(folder), 1)
    # From 350 degrees in the west to 10 in the east: half-way the wind blows from the north, and a little weaker.
    between = v[5, 7:9].mean()
    assert float(between) == pytest.approx(-8.0 * math.cos(math.radians(10.0)), rel=1e-5)
    assert float(u[5, 0]) == pytest.approx(8.0 * math.sin(math.radians(10.0)), rel=1e-5)


def test_an_ensembles_other_wind_turns_and_strengthens_the_field(folder):
    field = read(folder).fields.at(0)
    winds, _ = read(folder).fields.means
    turned = torch.stack((-winds[0, 1], winds[0, 0])) * 2.0  # to the left, twice as strong
    usual, other = (field.here(wind[None], torch.ones(1, 7), MAP)[0][0] for wind in (winds[0], turned))
    torch.testing.assert_close(other, 2.0 * torch.stack((-usual[1], usual[0])), atol=1e-5, rtol=0)


def test_rows_of_the_table_beside_say_when_and_what_no_raster_does(folder):
    (folder / "weather.csv").write_text("datetime,WS,WD,live_woody\n2024-07-01 12:00,1,0,77\n2024-07-01 15:00,1,0,77\n")
    found = read(folder, units={"wind_speed": "m/s", "WS": "m/s"})
    assert found.table.hours.tolist() == [0.0, 3.0] and found.table.live_woody.tolist() == [77.0, 77.0]
    speeds = found.table.wind_speed.tolist()  # of the rasters; between 350 and 10 degrees it is a little weaker
    assert speeds[0] == pytest.approx(5.5) and speeds[1] == pytest.approx(8.0, rel=0.005)
    assert float(found.table.wind_bearing[0]) == pytest.approx(270.0)


def test_wind_in_miles_an_hour_is_at_20_feet_and_bearings_are_from_true_north(folder):
    found = read(folder, units={"wind_speed": "mph"}, convergence=90.0)
    u, v = found.fields.wind[0, :, 0, 0]
    assert float(v) == pytest.approx(4.0 * 0.44704 * 1.15, rel=1e-5) and abs(float(u)) < 1e-5  # from grid south
    assert float(found.table.wind_bearing[0]) == pytest.approx(270.0, abs=1e-3)


def test_a_window_of_the_map_has_its_part_of_the_weather(folder):
    (u, _), _ = here(read(folder, corner=(0, 8), size=(12, 8)), 0)  # its points lie under columns 9.5 and 13.5 alone
    torch.testing.assert_close(u[:, 2:6], here(read(folder), 0)[0][0][:, 10:14])


def test_a_part_of_the_map_has_the_weather_of_the_whole_to_the_bit():
    values = torch.rand(9, 4, 5, generator=torch.Generator().manual_seed(1))
    field = Field(Lattice((1.5, 4.0), (2.0, 70.0)), values[:2], values[2:])
    wind, moisture = torch.tensor([[3.0, -2.0]]), torch.rand(1, 7)
    whole = field.here(wind, moisture, Window.whole((15, 300)))
    part = field.here(wind, moisture, Window(3, 64, 7, 128, (15, 300)))
    assert torch.equal(part[0], whole[0][:, :, 3:10, 64:192]) and torch.equal(part[1], whole[1][:, 3:10, 64:192])


def test_a_map_smaller_than_a_cell_of_the_weather_has_the_wind_between_the_middles_about_it(folder):
    # Middles of 2 km at x of -1600, 400 and 2400 m: u = 8 + 4 (x - 400) / 2000; columns 0 and 15 lie at 25 and 775 m.
    wide = {"cell": 2000.0, "crs": "EPSG:32631", "west": 5e5 - 2600.0}
    write(folder / "a_ws.tif", [[4.0, 8.0, 12.0]] * 2, **wide)
    write(folder / "a_wd.tif", [[270.0] * 3] * 2, **wide)
    write(folder / "a_m1.tif", [[4.0, 8.0, 12.0]] * 2, **wide)
    found = read(folder)
    (u, _), moisture = here(found, 0)
    torch.testing.assert_close(u[5, [0, 7, 15]], torch.tensor([7.25, 7.95, 8.75]))
    torch.testing.assert_close(moisture[5, [0, 7, 15], 0], torch.tensor([7.25, 7.95, 8.75]))
    assert float(found.table.wind_speed[0]) == pytest.approx(8.0)


def broken(folder, name):
    (folder / name).unlink()


@pytest.mark.parametrize(
    ("change", "message"),
    [
        (lambda folder: broken(folder, "a_wd.tif"), r"weather must have wind in .*, got a_m1.tif, a_ws.tif"),
        (lambda folder: write(folder / "b_m1.tif", np.ones((3, 4)), cell=200.0, **CRS), "one raster of dead_1h"),
        (lambda folder: write(folder / "a_m10.tif", np.ones((3, 4, 5)), cell=200.0, **CRS), "as many bands"),
        (lambda folder: write(folder / "a_wd.tif", np.ones((3, 3, 2)), cell=200.0, **CRS), "on the grid of wind_speed"),
        (lambda folder: write(folder / "a_ws.tif", np.full((3, 4, 2), 500.0), cell=200.0, **CRS), "at most 120 m/s"),
        (lambda folder: (folder / "weather.csv").write_text("WS [m/s],WD\n1,0\n"), "a row for each of the rasters' 2"),
    ],
)
def test_what_does_not_fit_is_refused(folder, change, message):
    change(folder)
    with pytest.raises(ValueError, match=message):
        read(folder)


def test_a_unit_that_no_file_states_is_asked_for(folder):
    with pytest.raises(ValueError, match=r"a_ws.tif must name its unit .* units.wind_speed=mph"):
        read(folder, units={})
