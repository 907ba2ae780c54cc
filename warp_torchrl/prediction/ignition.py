"""Where a prediction's fires start, from a file."""

import csv
from pathlib import Path

import torch
from torch import Tensor

from warp_torchrl.world.terrain.grid import Grid, check_grid
from warp_torchrl.world.terrain.layer import read_grid, read_layer


def read_ignition(path: str | Path, grid: Grid) -> Tensor:
    """Return the cells that a file lights, bool [rows, columns].

    Args:
        path: A CSV file of cells with columns ``row`` and ``column``, from 0, rows growing south; or a raster (.tif,
            .tiff, .asc) on the grid, not 0 where the fire starts.
        grid: The grid of the map.

    Raises:
        ValueError: If the file cannot be read, does not fit on the grid, or lights nothing.
    """
    path = Path(path)
    lit = _cells(path, grid) if path.suffix.lower() == ".csv" else _raster(path, grid)
    if not bool(lit.any()):
        raise ValueError(f"ignition must light a cell, {path} lights none")
    return lit


def _cells(path: Path, grid: Grid) -> Tensor:
    lit = torch.zeros(grid.shape, dtype=torch.bool)
    try:
        with path.open(encoding="utf-8-sig", newline="") as lines:
            cells = [(int(row["row"]), int(row["column"])) for row in csv.DictReader(lines, skipinitialspace=True)]
    except OSError as error:
        raise ValueError(f"ignition must be a file that can be read, got {path}: {error.strerror}") from None
    except (KeyError, TypeError, ValueError):
        raise ValueError(f"ignition must have whole numbers row and column in each line, {path} has not") from None
    for row, column in cells:
        if not (0 <= row < grid.shape[0] and 0 <= column < grid.shape[1]):
            size = f"{grid.shape[0]} x {grid.shape[1]}"
            raise ValueError(f"ignition must lie on the map of {size} cells, got row {row}, column {column} in {path}")
        lit[row, column] = True
    return lit


def _raster(path: Path, grid: Grid) -> Tensor:
    check_grid("ignition", read_grid("ignition", path), "fuel", grid)
    values, known = read_layer("ignition", path)
    return torch.from_numpy((values != 0) & known)
