"""A fire that happened: its ground, its weather, where it started, and what is known of where it burned by when."""

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np
import torch
from torch import Tensor

from warp_torchrl.calibration.null_models import mean_wind
from warp_torchrl.calibration.observed import read_perimeters
from warp_torchrl.weather.table import WeatherTable, read_weather
from warp_torchrl.world.alone import Spell
from warp_torchrl.world.state import OLDEST, Cover, Landscape
from warp_torchrl.world.terrain.cells import read_cells
from warp_torchrl.world.terrain.fuel import NO_FUEL
from warp_torchrl.world.terrain.grid import Grid, check_grid
from warp_torchrl.world.terrain.layer import find_layer, read_grid, read_layer
from warp_torchrl.world.weather import Weather

_KINDS = (".tif", ".tiff", ".asc")
_OUTCOMES = "scar (.tif, .asc), arrival (.tif, .asc) or perimeters.geojson"


@dataclass(frozen=True, kw_only=True, eq=False)
class FireCase:
    """One fire.

    Attributes:
        name: What it is called: its folder's name.
        landscape: Its ground, batch size [1].
        cell_size: Side of a cell [m].
        lit: Where it started, bool [H, W].
        spells: The weather from its start to the last hour known.
        minutes: When what burned is known, float32 [K] [minutes], growing.
        burned: What had burned by then, bool [K, H, W].
        arrival: When each cell burned, float32 [H, W] [minutes], NaN where not known; None where nowhere.
    """

    name: str
    landscape: Landscape
    cell_size: float
    lit: Tensor
    spells: Sequence[Spell]
    minutes: Tensor
    burned: Tensor
    arrival: Tensor | None = None

    def __post_init__(self) -> None:
        last = sum(spell.minutes for spell in self.spells)
        if not self.lit.any():
            raise ValueError(f"{self.name}: ignition must lie on the map, got no cell there")
        if not 0.0 < float(self.minutes[-1]) <= last + 1e-3:
            got = f"{float(self.minutes[-1]) / 60.0:g}"
            raise ValueError(
                f"{self.name}: the outcome must be known in hours of the weather, {last / 60.0:g}, got {got}"
            )
        if not self.scar.any():
            raise ValueError(f"{self.name}: scar must have a cell that burned, got none")

    @property
    def scar(self) -> Tensor:
        """Return what had burned by the last hour known, bool [H, W]."""
        return self.burned[-1]

    @property
    def last(self) -> float:
        """Return the last hour known [minutes]."""
        return float(self.minutes[-1])

    @property
    def wind(self) -> Tensor:
        """Return the mean wind as a vector, float32 [2] [m/s]."""
        winds = torch.stack([spell.wind for spell in self.spells])
        return mean_wind(winds, torch.tensor([spell.minutes for spell in self.spells]))


def read_case(folder: str | Path, hours: float | None = None, units: Mapping[str, str] | None = None) -> FireCase:
    """Read a fire from a folder.

    It holds ``fuel`` and, unless the ground is level, ``elevation`` [m], each a GeoTIFF (.tif) or an ESRI ASCII grid
    (.asc); ``weather.csv``, whose first row holds when the fire starts; ``ignition.csv`` (see ``read_cells``) or a
    raster ``ignition``, not 0 where it starts; and the outcome: ``perimeters.geojson``, or a raster ``arrival``
    [minutes from the start], or a raster ``scar``, over 0 where it burned by the last hour. Cells without fuel data
    do not burn; elevation that is not known is the mean of what is.

    Args:
        folder: The folder.
        hours: When the scar is known [h]; None is the end of the weather, whose last row lasts as the one before.
        units: Of columns of its weather that state none, see ``weather.table.read_weather``.

    Raises:
        ValueError: If a file is missing or does not fit, in one line that begins with the fire's name.
    """
    folder = Path(folder)
    if not folder.is_dir():
        raise ValueError(f"fires must name folders that exist, got {folder}")
    try:
        return _read(folder, hours, units)
    except ValueError as error:
        text = str(error)
        raise ValueError(text if text.startswith(f"{folder.name}: ") else f"{folder.name}: {text}") from None


def _read(folder: Path, hours: float | None, units: Mapping[str, str] | None) -> FireCase:
    fuel = _raster("fuel", folder)
    if fuel is None:
        raise ValueError(f"fuel must be fuel.tif or fuel.asc in {folder}, there is none")
    grid = read_grid("fuel", fuel)
    rows = _weather(folder / "weather.csv", units)
    weather = Weather(table=rows).over(_Placed(grid))  # type: ignore[arg-type]
    last = hours * 60.0 if hours is not None else _end(rows)
    minutes, burned, arrival = _outcome(folder, grid, last)
    return FireCase(
        name=folder.name,
        landscape=_landscape(folder, fuel, grid),
        cell_size=grid.cell_size,
        lit=_ignition(folder, grid),
        spells=[Spell(wind, lasts, moisture) for wind, moisture, lasts in weather.spells(float(minutes[-1]))],
        minutes=minutes,
        burned=burned,
        arrival=arrival,
    )


@dataclass(frozen=True)
class _Placed:
    """What a wind asks of a landscape to turn its bearings."""

    grid: Grid


def _weather(path: Path, units: Mapping[str, str] | None) -> WeatherTable:
    if not path.is_file():
        raise ValueError(f"weather must be {path.name} in {path.parent}, there is none")
    return read_weather(path, units=units)


def _end(rows: WeatherTable) -> float:
    """Return the minutes to the end of the last row, which lasts as long as the one before, or an hour."""
    lasts = float(rows.hours[-1] - rows.hours[-2]) if len(rows.hours) > 1 else 1.0
    return (float(rows.hours[-1]) + lasts) * 60.0


def _landscape(folder: Path, fuel: Path, grid: Grid) -> Landscape:
    codes, known = read_layer("fuel", fuel)
    broken = known & ((codes != np.rint(codes)) | (codes < 0) | (codes > 32767))
    if broken.any():
        raise ValueError(f"fuel must hold whole codes of fuels, 0..32767, got {codes[broken][0]:g}")
    codes = np.where(known, codes, NO_FUEL).astype(np.int16)
    cover = torch.full((1, *grid.shape), int(Cover.FOREST), dtype=torch.uint8)
    return Landscape(
        cover=cover,
        age=torch.full_like(cover, OLDEST),
        elevation=_elevation(folder, grid),
        fuel=torch.from_numpy(codes)[None],
    )


def _elevation(folder: Path, grid: Grid) -> Tensor | None:
    path = _raster("elevation", folder)
    if path is None:
        return None
    values, known = _on_grid("elevation", path, grid)
    filled = np.where(known, values, values[known].mean()).astype(np.float32)
    return torch.from_numpy(filled)[None]


def _ignition(folder: Path, grid: Grid) -> Tensor:
    path = _raster("ignition", folder)
    if path is not None:
        values, known = _on_grid("ignition", path, grid)
        return torch.from_numpy(known & (values != 0))
    points = folder / "ignition.csv"
    if not points.is_file():
        raise ValueError(f"ignition must be ignition.csv, .tif or .asc in {folder}, there is none")
    return torch.from_numpy(read_cells("ignition", points, grid))


def _outcome(folder: Path, grid: Grid, last: float) -> tuple[Tensor, Tensor, Tensor | None]:
    """Return the minutes at which what burned is known, what burned by then, and when each cell burned."""
    perimeters = folder / "perimeters.geojson"
    if perimeters.is_file():
        return *read_perimeters(perimeters, grid), None
    path = _raster("arrival", folder)
    if path is not None:
        values, known = _on_grid("arrival", path, grid)
        return _by_hour(torch.from_numpy(np.where(known, values, math.nan).astype(np.float32)))
    path = _raster("scar", folder)
    if path is None:
        raise ValueError(f"the outcome must be {_OUTCOMES} in {folder}, there is none")
    values, known = _on_grid("scar", path, grid)
    return torch.tensor([last]), torch.from_numpy(known & (values > 0))[None], None


def _by_hour(arrival: Tensor) -> tuple[Tensor, Tensor, Tensor]:
    """Return what burned by each full hour until the last cell did."""
    latest = float(arrival[~arrival.isnan()].max())
    minutes = torch.arange(1.0, max(1.0, math.ceil(latest / 60.0)) + 1.0) * 60.0
    return minutes, arrival <= minutes[:, None, None], arrival


def _on_grid(name: str, path: Path, grid: Grid) -> tuple[np.ndarray, np.ndarray]:
    check_grid(name, read_grid(name, path), "fuel", grid)
    return read_layer(name, path)


def _raster(name: str, folder: Path) -> Path | None:
    """Return the one raster of a name in a folder; None where there is none."""
    there = [folder / f"{name}{kind}" for kind in _KINDS if (folder / f"{name}{kind}").exists()]
    return find_layer(name, folder, there[0].name if len(there) == 1 else f"{name}.*") if there else None
