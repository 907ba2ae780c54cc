"""Ground of a real fire: its fuel, elevation and canopy."""

from dataclasses import replace
from pathlib import Path

import torch
from torch import Tensor

from warp_torchrl.prediction.calibration.folder import found
from warp_torchrl.world.state.state import OLDEST, Cover, Landscape
from warp_torchrl.world.terrain.crop import CROWN_LAYERS, check_crowns
from warp_torchrl.world.terrain.fuel import is_code
from warp_torchrl.world.terrain.grid import Grid, check_grid
from warp_torchrl.world.terrain.layer import Header, read_header, read_layer
from warp_torchrl.world.terrain.layers import CanopyUnits, canopy_plane, elevation_unit
from warp_torchrl.world.terrain.planes import check_slopes, to_fuel, to_metres
from warp_torchrl.world.terrain.resampling import fill


def read_ground(folder: Path, header: Header, units: CanopyUnits) -> tuple[Landscape, list[str]]:
    """Return the ground, and a line for each of its layers but the fuel.

    Beside ``fuel`` these may lie, each on its grid: ``elevation``, ``canopy_cover`` [%] and ``canopy_height``, by which
    the wind is slowed down, and ``canopy_base_height`` and ``canopy_bulk_density``, by which fires run in crowns.

    Raises:
        ValueError: If a layer does not fit, or crowns are not whole.
    """
    bare = _of_fuel(header)
    path = found("elevation", folder)
    elevation, told = (
        (None, ["elevation: none, the ground is level"]) if path is None else _elevation(path, header.grid)
    )
    canopy, of_canopy = _canopy(folder, header.grid, units)
    return replace(bare, elevation=elevation).with_layers(**canopy), [*told, *of_canopy]


def read_fuel(path: Path) -> tuple[Header, Landscape]:
    """Return the header of a raster of fuel codes, and level ground with these fuels.

    Raises:
        ValueError: If it cannot be read.
    """
    header = read_header("fuel", path)
    return header, _of_fuel(header)


def _of_fuel(header: Header) -> Landscape:
    codes, known = read_layer("fuel", header.path, header.number)
    fuel = to_fuel(codes, known & is_code(codes, {}))
    cover = torch.full((1, *header.grid.shape), int(Cover.FOREST), dtype=torch.uint8)
    bare = Landscape(cover=cover, age=torch.full_like(cover, OLDEST), elevation=None)
    return bare.with_layers(fuel=torch.from_numpy(fuel)[None])


def _canopy(folder: Path, grid: Grid, units: CanopyUnits) -> tuple[dict[str, Tensor], list[str]]:
    """Return the layers of the canopy that are there, float32 [1, H, W], and a line for each."""
    names = ("canopy_cover", "canopy_height", *CROWN_LAYERS)
    paths = {name: path for name in names if (path := found(name, folder)) is not None}
    check_crowns(tuple(paths), ("canopy_cover", "canopy_height"))
    layers, told = dict[str, Tensor](), []
    for name, path in paths.items():
        header = read_header(name, path)
        check_grid(name, header.grid, "fuel", grid)
        values, known = read_layer(name, path, header.number)
        plane, unit = canopy_plane(name, values, known, header, units)
        layers[name] = torch.from_numpy(plane)[None]
        told.append(f"{name}: {header.description} [{unit}]")
    return layers, told


def _elevation(path: Path | None, grid: Grid) -> tuple[Tensor | None, list[str]]:
    if path is None:
        return None, ["elevation: none, the ground is level"]
    header = read_header("elevation", path)
    check_grid("elevation", header.grid, "fuel", grid)
    values, known = read_layer("elevation", path, header.number)
    unit = elevation_unit(header, None)
    metres = to_metres(values, known, unit)
    if not header.unit:
        check_slopes(metres, known, grid.cell_size)
    told = f"elevation: {header.description} [{header.unit or 'm'}]"
    return torch.from_numpy(fill(metres, known))[None], [told]
