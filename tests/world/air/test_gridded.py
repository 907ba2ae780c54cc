"""Winds of the user's own: the window that a world gets, series in time, layers on other grids, and refusals."""

import math

import numpy as np
import pytest
import torch
from torch import Tensor

from tests.world.drawing import draw
from warp_torchrl.world.air.gridded import Gridded
from warp_torchrl.world.arrays.random import world_key
from warp_torchrl.world.backends.tick import advance, in_wind
from warp_torchrl.world.team.team import Team
from warp_torchrl.world.terrain.array import Array
from warp_torchrl.world.terrain.landscape import Perlin
from warp_torchrl.world.world import World

ROWS, COLUMNS = 12, 14
U = np.arange(ROWS * COLUMNS, dtype=np.float64).reshape(ROWS, COLUMNS) / 20.0  # tells each cell by its value
V = -U


def keys(worlds: int) -> Tensor:
    return world_key(torch.arange(worlds))


def everywhere(value: int) -> list[list[int]]:
    return [[value] * COLUMNS for _ in range(ROWS)]


def test_a_field_of_arrays_is_each_world_s_wind() -> None:
    wind = Gridded(u=U, v=V)
    field = wind(keys(3), (ROWS, COLUMNS))
    assert field.dtype == torch.float32 and field.shape == (3, 2, ROWS, COLUMNS)
    assert torch.equal(field[2], torch.from_numpy(np.stack((U, V))).float())
    assert not wind.changes


def test_a_world_has_the_wind_of_its_window() -> None:
    ground = Array(cover=everywhere(3), size=5)
    world = World(landscape=ground, wind=Gridded(u=U, v=V), team=Team(n_agents=1))
    state = world.reset(torch.arange(16), torch.zeros(16, dtype=torch.int64))
    corner = state.landscape.corner
    assert len({tuple(each) for each in corner.tolist()}) > 4
    for world_index in range(16):
        row, column = corner[world_index].tolist()
        window = torch.from_numpy(U[row : row + 5, column : column + 5]).float()
        assert torch.equal(state.wind[world_index, 0], window)
        assert torch.equal(state.wind[world_index, 1], -window)


def test_a_series_in_time_holds_each_field_for_its_ticks_and_the_last_for_good() -> None:
    u = np.stack([np.full((3, 4), speed) for speed in (1.0, 2.0, 3.0)])
    wind = Gridded(u=u, v=np.zeros_like(u), ticks_per_field=2)
    state = draw("TTTT TTTT TTTT", worlds=2)
    fire = World().fire
    state = in_wind(state, fire, wind(state.key, (3, 4)))
    seen = [state.wind[0, 0, 0, 0].item()]
    for _ in range(7):
        state = advance(state, fire, wind, torch.tensor([True, False]))
        seen.append(state.wind[0, 0, 0, 0].item())
    assert wind.changes
    assert seen == [1.0, 1.0, 2.0, 2.0, 3.0, 3.0, 3.0, 3.0]
    assert (state.wind[1, 0] == 1.0).all()  # the world that did not tick


def test_an_npz_file_holds_u_and_v(tmp_path) -> None:
    path = tmp_path / "wind.npz"
    np.savez(path, u=U, v=V)
    assert torch.equal(Gridded(path=path)(keys(1), (ROWS, COLUMNS)), Gridded(u=U, v=V)(keys(1), (ROWS, COLUMNS)))


@pytest.mark.parametrize(
    ("options", "message"),
    [
        ({}, "path must name a folder"),
        ({"path": "nowhere"}, "path must name"),
        ({"u": U}, "path must name"),
        ({"u": U, "v": V[:5]}, "v must have the shape of u"),
        ({"u": U[0], "v": V[0]}, "u must hold numbers in"),
        ({"u": np.full((2, 2), np.inf), "v": V[:2, :2]}, "u must be in"),
        ({"u": U, "v": V * 1000.0}, "v must be in"),
        ({"u": U, "v": V, "speed": "*vel*"}, "bearing must be given with speed"),
        ({"u": U, "v": V, "ticks_per_field": 0}, "ticks_per_field must be"),
        ({"u": U, "v": V, "resample": "nearest"}, "resample must be refuse or bilinear, got 'nearest'"),
        ({"u": [["a"]], "v": V}, "u must hold numbers in"),
    ],
)
def test_what_is_no_wind_is_an_error_that_names_it(options, message) -> None:
    with pytest.raises(ValueError, match=message) as caught:
        Gridded(**options)
    assert "\n" not in str(caught.value)


def test_a_wind_of_another_shape_than_the_map_is_an_error() -> None:
    with pytest.raises(ValueError, match=r"wind must have the shape of the landscape's map, \[16, 16\], got"):
        World(landscape=Perlin(size=16), wind=Gridded(u=U, v=V))
    World(landscape=Perlin(size=(ROWS, COLUMNS)), wind=Gridded(u=U, v=V))


def test_a_wind_must_be_known_only_where_a_world_may_lie() -> None:
    u = U.copy()
    u[0, 0] = np.nan
    cover = np.full((ROWS, COLUMNS), 3)
    with pytest.raises(ValueError, match="known wherever a world may lie, it is not in 1 cells"):
        World(landscape=Array(cover=cover, size=5), wind=Gridded(u=u, v=V))
    World(landscape=Array(cover=cover, size=5, row=1, column=0), wind=Gridded(u=u, v=V))
    with pytest.raises(ValueError, match="not in 1 cells"):
        World(landscape=Perlin(size=(ROWS, COLUMNS)), wind=Gridded(u=u, v=V))


# Rasters.


@pytest.fixture
def folder(tmp_path):
    rasterio = pytest.importorskip("rasterio")
    assert rasterio
    return tmp_path


def write_layer(path, values, cell=30.0, nodata=-9999.0):
    from tests.world.rasters import write

    return write(path, values, cell=cell, nodata=nodata)


def raster_world(folder, wind, **options):
    from warp_torchrl.world.terrain.raster import Raster

    write_layer(folder / "F13.tif", np.full((ROWS, COLUMNS), 8))
    ground = Raster(path=folder, elevation=None, size=6, **options)
    return World(landscape=ground, wind=wind, team=Team(n_agents=1))


def test_layers_of_u_and_v_lie_on_the_ground_s_grid(folder) -> None:
    write_layer(folder / "wind_u.tif", U)
    write_layer(folder / "wind_v.tif", V)
    world = raster_world(folder, Gridded(path=folder))
    state = world.reset(torch.arange(4), torch.zeros(4, dtype=torch.int64))
    row, column = state.landscape.corner[3].tolist()
    window = torch.from_numpy(U[row : row + 6, column : column + 6]).float()
    torch.testing.assert_close(state.wind[3, 0], window)


def test_a_bearing_is_where_the_wind_comes_from(folder) -> None:
    # From the north (0) it blows to the south, v < 0; from the west (270) to the east, u > 0.
    write_layer(folder / "a_vel.tif", np.full((2, 2), 5.0))
    write_layer(folder / "a_ang.tif", [[0.0, 90.0], [180.0, 270.0]])
    u, v = Gridded(path=folder, speed="*_vel.*", bearing="*_ang.*")(keys(1), (2, 2))[0]
    torch.testing.assert_close(u, torch.tensor([[0.0, -5.0], [0.0, 5.0]]), atol=1e-5, rtol=0)
    torch.testing.assert_close(v, torch.tensor([[-5.0, 0.0], [5.0, 0.0]]), atol=1e-5, rtol=0)


def test_a_coarse_wind_is_refused_or_interpolated(folder) -> None:
    # Cells of 60 m, u a plane that rises to the east by 1 m/s a cell, so by 0.5 a cell of 30 m between the middles:
    # fine column c, middle 30 c + 15 m, lies (c - 0.5) / 2 coarse columns from the first one's.
    coarse = np.tile(np.arange(COLUMNS // 2, dtype=float), (ROWS // 2, 1))
    write_layer(folder / "wind_u.tif", coarse, cell=60.0)
    write_layer(folder / "wind_v.tif", np.zeros_like(coarse), cell=60.0)
    with pytest.raises(ValueError, match="wind must have the shape of the landscape"):
        raster_world(folder, Gridded(path=folder))
    world = raster_world(folder, Gridded(path=folder, resample="bilinear"), row=3, column=4)
    state = world.reset(torch.arange(1), torch.zeros(1, dtype=torch.int64))
    wanted = (torch.arange(4.0, 10.0) - 0.5) / 2.0
    torch.testing.assert_close(state.wind[0, 0], wanted.expand(6, 6), atol=1e-5, rtol=0)
    assert isinstance(world.wind, Gridded) and world.air is not world.wind


def test_interpolated_bearings_do_not_turn_the_long_way(folder) -> None:
    # Between 350 and 10 degrees lies north, not south: components are interpolated, not angles.
    write_layer(folder / "a_vel.tif", np.full((ROWS // 2, COLUMNS // 2), 6.0), cell=60.0)
    angles = np.tile([350.0, 10.0, 350.0, 10.0, 350.0, 10.0, 350.0], (ROWS // 2, 1))
    write_layer(folder / "a_ang.tif", angles, cell=60.0)
    wind = Gridded(path=folder, speed="*_vel.*", bearing="*_ang.*", resample="bilinear")
    state = raster_world(folder, wind).reset(torch.arange(2), torch.zeros(2, dtype=torch.int64))
    assert (state.wind[:, 1] < -6.0 * math.cos(math.radians(10.0)) + 1e-4).all()


def test_layers_of_a_wind_on_two_grids_are_an_error(folder) -> None:
    write_layer(folder / "wind_u.tif", U)
    write_layer(folder / "wind_v.tif", V, cell=60.0)
    with pytest.raises(ValueError, match="v must have the bounds of u"):
        Gridded(path=folder)


def test_the_command_line_takes_a_wind(folder) -> None:
    from warp_torchrl import make_env

    np.savez(folder / "wind.npz", u=np.full((16, 16), 3.0), v=np.zeros((16, 16)))
    env = make_env("skirmish", n_worlds=2, overrides=["wind=gridded", f"wind.path={folder}/wind.npz"])
    env.rollout(6, break_when_any_done=False)
    assert (env.world_state.wind[:, 0] == 3.0).all()
