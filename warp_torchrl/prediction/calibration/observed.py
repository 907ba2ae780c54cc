"""Observations of a fire: perimeters by hour, times of arrival, or a scar."""

import math
import re
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
import torch
from torch import Tensor

from warp_torchrl.world.terrain.bands import MINUTES, factor_of
from warp_torchrl.world.terrain.cells import check_lies_on, read_cells
from warp_torchrl.world.terrain.grid import Grid
from warp_torchrl.world.terrain.layer import read_header, read_layer
from warp_torchrl.world.terrain.vector import Shape, mark, read_shapes

_LONGEST = 1e7  # minutes since the ignition that are believed
_OTHER_TIMES = re.compile(r"hour|hrs?$|time|date|days?$|minute|mins?$", re.IGNORECASE)
"""Names of properties that tell times which are not read."""


class Outcome(NamedTuple):
    """The cells that had burned by some times, and the time when each cell burned."""

    minutes: Tensor  # float32 [K], growing
    burned: Tensor  # bool [K, H, W]
    arrival: Tensor | None = None  # float32 [H, W] [minutes], NaN where not known


def read_perimeters(path: Path, grid: Grid, end: float | None = None, is_stated: bool = False) -> tuple[Tensor, Tensor]:
    """Return what had burned by some times: the cells that perimeters mark, see ``vector.mark``.

    Each feature has ``minutes`` or ``hours`` since the ignition among its properties; features of one time are one.
    Where none has, they are known at the end. What burned stays burned.

    Args:
        path: GeoJSON or a shapefile.
        grid: The grid.
        end: When features without a time are known [minutes]; None refuses them.
        is_stated: Whether the user gave that end; else some features without a time beside others are refused.

    Returns:
        The times, float32 [K] [minutes], growing, and the cells, bool [K, H, W].

    Raises:
        ValueError: If the file cannot be read or placed, holds other shapes, or a feature has no time.
    """
    shapes = read_shapes(path.name, path, grid)
    if any(shape.part.kind != "Polygon" for shape in shapes):
        kinds = sorted({shape.part.kind for shape in shapes})
        raise ValueError(f"{path.name} must hold polygons, got {', '.join(kinds)}")
    timed = [bool(_times(shape.properties)) for shape in shapes]
    if not is_stated and not any(timed):
        _check_other_times(shapes, path)
    end = end if is_stated or not any(timed) else None
    by_time: dict[float, list[Shape]] = {}
    for shape in shapes:
        by_time.setdefault(_minutes(shape.properties, path, end), []).append(shape)
    times = sorted(by_time)
    cells = torch.stack([torch.from_numpy(mark(by_time[time], grid)) for time in times])
    return torch.tensor(times), cells.to(torch.int8).cummax(0).values.to(torch.bool)


def read_arrival(path: Path, grid: Grid) -> Outcome:
    """Return what burned by each full hour until the last cell did, from a raster of minutes since the ignition.

    Numbers below 0 say that a cell did not burn, as the -9999 of files that declare no nodata.

    Raises:
        ValueError: If the file cannot be read, does not lie on the grid, or no cell has a time that can be.
    """
    header = read_header("arrival", path, metric=False)
    check_lies_on("arrival", header.grid, grid)
    values, known = read_layer("arrival", path, header.number)
    known &= ~(values < 0.0)
    minutes = values * factor_of("arrival", path, header.unit, MINUTES)
    broken = known & ~(minutes <= _LONGEST)
    if broken.any():
        raise ValueError(f"arrival must be minutes, at most {_LONGEST:g}, got {minutes[broken][0]:g}")
    if not known.any():
        raise ValueError(f"arrival must hold a time of 0 or more, {path} holds none")
    arrival = torch.from_numpy(np.where(known, minutes, math.nan).astype(np.float32))
    hours = max(1.0, math.ceil(float(minutes[known].max()) / 60.0))
    by = torch.arange(1.0, hours + 1.0) * 60.0
    return Outcome(by, arrival <= by[:, None, None], arrival)


def read_scar(path: Path, grid: Grid, end: float) -> Outcome:
    """Return what had burned at the end [minutes]: the cells that a raster marks, see ``cells.read_marks``.

    Raises:
        ValueError: If the file cannot be read, or marks no cell of the grid.
    """
    return Outcome(torch.tensor([end]), torch.from_numpy(read_cells("scar", path, grid))[None])


def _check_other_times(shapes: Sequence[Shape], path: Path) -> None:
    """Refuse features that differ in a time property that is not read: they would count as one time."""
    names = {str(name) for shape in shapes for name in shape.properties if _OTHER_TIMES.search(str(name))}
    for name in sorted(names):
        values = {str(shape.properties.get(name)) for shape in shapes}
        if len(values) > 1:
            got = ", ".join(sorted(values)[:2])
            rule = "tell times by minutes or hours since the ignition, or hours= must say when all are known"
            raise ValueError(f"{path.name} must {rule}, its features have {name} {got}")


def _minutes(told: Mapping[str, Any], path: Path, end: float | None) -> float:
    """Return the minutes of a feature's properties, of numbers or of texts of numbers; the end where it has none."""
    pairs = _times(told)
    value, factor = pairs[0] if pairs else (end, 1.0)
    try:
        minutes = float(value) * factor  # type: ignore[arg-type]  # None has no float
    except (TypeError, ValueError, OverflowError):
        minutes = math.nan
    if isinstance(value, bool) or not 0.0 < minutes < _LONGEST:
        rule = "have features with minutes or hours over 0, or none that has, or hours= must say when they are known"
        raise ValueError(f"{path.name} must {rule}, got {value!r}")
    return minutes


def _times(told: Mapping[str, Any]) -> list[tuple[Any, float]]:
    """Return the times in a feature's properties, each with the minutes of its unit."""
    named = {str(name).lower(): value for name, value in told.items() if value is not None}
    return [(named[name], factor) for name, factor in (("minutes", 1.0), ("hours", 60.0)) if name in named]
