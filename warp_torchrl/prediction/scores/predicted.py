"""Maps of a predicted fire: times of arrival of one fire or of an ensemble, and burn probability."""

import json
from dataclasses import dataclass
from pathlib import Path
from typing import cast

import numpy as np
import torch
from torch import Tensor

from warp_torchrl.prediction.scores.arrivals import burn_probability
from warp_torchrl.world.law.travel import NEVER
from warp_torchrl.world.terrain.bands import MINUTES, factor_of
from warp_torchrl.world.terrain.cells import check_lies_on
from warp_torchrl.world.terrain.grid import Grid
from warp_torchrl.world.terrain.layer import Header, read_header, read_layer

HALF = "half"
"""Band of the times at which half of all fires of a prediction had arrived."""
_OF_PREDICTION = ("arrivals.tif", "arrival_hours.tif")
_UNITS = {"minutes": 1.0, "hours": 60.0}
_LARGEST_REPORT = 50_000_000  # bytes


@dataclass(frozen=True, kw_only=True, eq=False)
class Predicted:
    """A predicted fire.

    Attributes:
        grid: Of its cells.
        arrival: When each fire of an ensemble reaches each cell, float32 [F, H, W] [minutes after the start], ``NEVER``
            where it does not; None where the times are not known.
        probability: Burn probability at the last observation, float32 [H, W]; None takes the share of the fires.
    """

    grid: Grid
    arrival: Tensor | None = None
    probability: Tensor | None = None

    @property
    def is_ensemble(self) -> bool:
        """Return whether it has probabilities other than 0 and 1."""
        return self.probability is not None or (self.arrival is not None and len(self.arrival) > 1)

    def chance(self, minutes: float, is_last: bool = False) -> Tensor:
        """Return the burn probability by a time, that of the last observation or another, float32 [H, W]."""
        if self.probability is not None and (is_last or self.arrival is None):
            return self.probability
        return burn_probability(cast("Tensor", self.arrival), minutes)

    def areas(self, minutes: float) -> Tensor | None:
        """Return the area that each fire burned by a time, float32 [F] [ha]; None where times are not known."""
        if self.arrival is None:
            return None
        return (self.arrival <= minutes).flatten(1).sum(1).to(torch.float32) * (self.grid.cell_size**2 / 10_000.0)


def read_predicted(
    arrival: str | None, probability: str | None, unit: str | None = None, begun: float = 0.0
) -> Predicted:
    """Read a predicted fire.

    Args:
        arrival: A raster of times: one band, or the band "half" of a prediction, or a band for each fire; or the folder
            of a prediction. Cells of nodata, and of numbers below 0, are not reached.
        probability: A raster on the same grid.
        unit: ``minutes`` or ``hours``, where the bands state none.
        begun: When the times begin [minutes after the start].

    Raises:
        ValueError: If a file cannot be read, its times have no unit, or the grids differ.
    """
    times, grid = (None, None) if arrival is None else _times(Path(arrival), unit, begun)
    chance = None
    if probability is not None:
        header = read_header("probability", Path(probability), metric=False)
        if grid is not None:
            check_lies_on("probability", header.grid, grid)
        values, known = read_layer("probability", header.path, header.number)
        chance = torch.from_numpy(np.where(known & np.isfinite(values), values, 0.0).astype(np.float32))
        if not bool(((chance >= 0.0) & (chance <= 1.0)).all()):
            raise ValueError(f"probability must be in 0..1, {probability} has {float(chance.abs().max()):g}")
        grid = grid or header.grid
    if grid is None:
        raise ValueError("arrival or probability must name a file")
    return Predicted(grid=grid, arrival=times, probability=chance)


def followed_minutes(arrival: str | None) -> float | None:
    """Return for how long the fires of a prediction's folder were followed [minutes]; None where nothing says it."""
    report = Path(arrival or "") / "report.json"
    if arrival is None or not report.is_file() or report.stat().st_size > _LARGEST_REPORT:
        return None
    try:
        return float(json.loads(report.read_text())["followed_minutes"]["high"])
    except (ValueError, KeyError, TypeError):
        raise ValueError(f"arrival must be the folder of a prediction, {report} is none of its reports") from None


def _times(path: Path, unit: str | None, begun: float) -> tuple[Tensor, Grid]:
    if path.is_dir():
        there = [path / name for name in _OF_PREDICTION if (path / name).is_file()]
        if not there:
            raise ValueError(f"arrival must be a raster, or a folder with {' or '.join(_OF_PREDICTION)}, got {path}")
        path = there[0]
    first = read_header("arrival", path, metric=False, band=1)
    numbers = [first.bands.index(HALF) + 1] if HALF in first.bands else range(1, len(first.bands) + 1)
    return torch.stack([_band(path, number, unit, begun) for number in numbers]), first.grid


def _band(path: Path, number: int, unit: str | None, begun: float) -> Tensor:
    header = read_header("arrival", path, metric=False, band=number)
    values, known = read_layer("arrival", path, number)
    known = known & np.isfinite(values) & (values >= 0.0)
    minutes = begun + values * _factor(header, unit)
    return torch.from_numpy(np.where(known, minutes, NEVER).astype(np.float32))


def _factor(header: Header, unit: str | None) -> float:
    if not header.unit and unit is None:
        raise ValueError(f"unit must be minutes or hours, as {header.path} states none, got null")
    return factor_of("arrival", header.path, header.unit, MINUTES, None if unit is None else _UNITS[unit])
