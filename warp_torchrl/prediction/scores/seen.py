"""Sightings of a fire: the cells that had burned by some times, from files of several kinds."""

import math
from collections.abc import Sequence
from dataclasses import dataclass, field
from itertools import pairwise
from pathlib import Path

import torch
from torch import Tensor

from warp_torchrl.prediction.calibration.observed import Outcome, read_arrival, read_perimeters, read_scar
from warp_torchrl.prediction.observed.observation import Observation
from warp_torchrl.prediction.observed.reading import Moment, read_observations
from warp_torchrl.prediction.scores.hull import hull_cells
from warp_torchrl.world.fires.sightings import HotSpotSensor
from warp_torchrl.world.terrain.grid import Grid
from warp_torchrl.world.terrain.layer import RASTERS, read_header

_MOST_TIMES = 6  # of a raster of arrival
_FOREVER = 1e8  # minutes


@dataclass(frozen=True, kw_only=True, eq=False)
class Seen:
    """What had burned by a time.

    Attributes:
        minutes: After the start.
        kind: ``perimeter``, ``hot spots``, ``arrival`` or ``scar``.
        burned: bool [H, W].
    """

    minutes: float
    kind: str
    burned: Tensor


@dataclass(frozen=True, kw_only=True)
class Reading:
    """How files of what was seen are read.

    Attributes:
        moment: Function from a date and time to minutes after the start.
        hours: When scars, and perimeters without a time, are known [h]; None: at the end of all times.
        sensor: The satellite.
        hull: Ratio of the concave hull of hot spots; None takes the pixels about them.
    """

    moment: Moment
    hours: float | None = None
    sensor: HotSpotSensor = field(default_factory=HotSpotSensor)
    hull: float | None = None


def read_seen(files: Sequence[str], grid: Grid, how: Reading) -> tuple[list[Seen], Tensor | None]:
    """Return what had burned by each time, and when each cell burned where a raster says it.

    What burned stays burned: each time has the cells of all before it.

    Args:
        files: See ``ScoreOptions.observed``.
        grid: Of the prediction.
        how: How they are read.

    Returns:
        The observations in the order of time, and float32 [H, W] [minutes], NaN where not known, or None.

    Raises:
        ValueError: If a file is missing, cannot be read or placed, or says no time.
    """
    found: list[Seen] = []
    arrival = None
    for name in files:
        path = Path(name)
        if not path.is_file():
            raise ValueError(f"observed must name files that exist, got {name}")
        if path.suffix.lower() in RASTERS:
            outcome, kind = _of_raster(path, grid, how)
            arrival = outcome.arrival if arrival is None else arrival
            found += _of_outcome(outcome, kind)
        elif path.suffix.lower() != ".csv" and how.hours is not None:
            found += _of_outcome(Outcome(*read_perimeters(path, grid, how.hours * 60.0, True)), "perimeter")
        else:
            read = read_observations(path, grid, (0, 0), grid.shape, how.moment, math.inf)
            found += _of_observations(read, grid, how)
    found.sort(key=lambda each: each.minutes)
    for before, each in pairwise(found):
        each.burned.logical_or_(before.burned)
    return found, arrival


def _of_raster(path: Path, grid: Grid, how: Reading) -> tuple[Outcome, str]:
    """Return what a raster shows: times of arrival where its name or its band says so, else a scar."""
    header = read_header("observed", path, metric=False)
    if "arrival" in f"{path.stem} {header.bands[header.number - 1]}".lower():
        outcome = read_arrival(path, grid)
        step = math.ceil(len(outcome.minutes) / _MOST_TIMES)
        kept = torch.arange(len(outcome.minutes) - 1, -1, -step).flip(0)
        return Outcome(outcome.minutes[kept], outcome.burned[kept], outcome.arrival), "arrival"
    return read_scar(path, grid, _FOREVER if how.hours is None else how.hours * 60.0), "scar"


def _of_outcome(outcome: Outcome, kind: str) -> list[Seen]:
    pairs = zip(outcome.minutes.tolist(), outcome.burned, strict=True)
    return [Seen(minutes=minutes, kind=kind, burned=burned.clone()) for minutes, burned in pairs]


def _of_observations(read: Sequence[Observation], grid: Grid, how: Reading) -> list[Seen]:
    found: list[Seen] = []
    hot = burned = torch.zeros(grid.shape, dtype=torch.bool)
    for each in read:
        if each.kind == "hot_spots" and how.hull is not None:
            hot = hot | each.cells
            burned = burned | hull_cells(hot, how.hull)
        else:
            burned = each.burned(burned, how.sensor, how.sensor.side(grid.cell_size))
        found.append(Seen(minutes=each.minutes, kind=each.kind.replace("_", " "), burned=burned.clone()))
    return found
