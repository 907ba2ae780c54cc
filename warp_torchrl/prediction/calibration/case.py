"""A real fire: its ground, weather and ignition, and the cells known to have burned by known times."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path

import torch
from torch import Tensor

from warp_torchrl.prediction.calibration.folder import KINDS, found, only
from warp_torchrl.prediction.calibration.ground import read_ground
from warp_torchrl.prediction.calibration.observed import Outcome, read_arrival, read_perimeters, read_scar
from warp_torchrl.prediction.scores.null_models import mean_wind
from warp_torchrl.world.air.weather import Weather
from warp_torchrl.world.fires.spell import Spell, spells_of
from warp_torchrl.world.state.state import Landscape
from warp_torchrl.world.terrain.cells import read_cells
from warp_torchrl.world.terrain.grid import Grid
from warp_torchrl.world.terrain.layer import read_header
from warp_torchrl.world.terrain.layers import AS_STATED, CanopyUnits, unread_files
from warp_torchrl.world.weather.table import WeatherTable, read_weather

_OUTCOMES = "scar (.tif, .asc, .geojson, .shp), arrival (.tif, .asc) or perimeters (.geojson, .shp)"
_REMEDY = "it to gdalwarp -t_srs EPSG:326ZONE -tr 30 30 -r mode"


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
        files: A line for each file: what it is, in which unit, and what is left unread.
    """

    name: str
    landscape: Landscape
    cell_size: float
    lit: Tensor
    spells: Sequence[Spell]
    minutes: Tensor
    burned: Tensor
    arrival: Tensor | None = None
    files: Sequence[str] = ()

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


def read_fire_case(
    folder: str | Path,
    hours: float | None = None,
    units: Mapping[str, str] | None = None,
    canopy: CanopyUnits = AS_STATED,
) -> FireCase:
    """Read a fire from a folder.

    It holds ``fuel`` and, unless the ground is level, ``elevation``, each a GeoTIFF (.tif) or an ESRI ASCII grid
    (.asc), and maybe a canopy, see ``ground.read_ground``; ``weather.csv``, whose first row holds when the fire starts;
    ``ignition``, any file that ``read_cells`` reads; and the outcome: ``perimeters`` (GeoJSON or a shapefile), or a
    raster ``arrival`` [minutes from the start], or a ``scar``, a raster over 0 where it burned by the last hour,
    GeoJSON or a shapefile. Cells without fuel data do not burn; elevation that is not known is that of the cells
    around.

    Args:
        folder: The folder.
        hours: When a scar, or perimeters without a time, are known [h]; None is the end of the weather, whose last row
            lasts as the one before.
        units: Of columns of its weather that state none, see ``weather.table.read_weather``.
        canopy: Units of its canopy.

    Raises:
        ValueError: If a file is missing or does not fit, in one line that begins with the fire's name.
    """
    folder = Path(folder)
    if not folder.is_dir():
        raise ValueError(f"fires must name folders that exist, got {folder}")
    try:
        return _read(folder, hours, units, canopy)
    except ValueError as error:
        text = str(error)
        raise ValueError(text if text.startswith(f"{folder.name}: ") else f"{folder.name}: {text}") from None


def _read(folder: Path, hours: float | None, units: Mapping[str, str] | None, canopy: CanopyUnits) -> FireCase:
    fuel = only("fuel", folder)
    header = read_header("fuel", fuel, remedy=_REMEDY)
    rows = _weather(folder / "weather.csv", units)
    weather, end = Weather(table=rows).over(Placed(header.grid)), _end(rows)  # type: ignore[arg-type]
    outcome, observed = _outcome(folder, header.grid, hours, end)
    last = float(outcome.minutes[-1])
    if last > end + 1e-3:
        got = f"{last / 60.0:g}"
        raise ValueError(f"the outcome must be known in hours of the weather, {end / 60.0:g}, got {got}")
    landscape, layers = read_ground(folder, header, canopy)
    lit = only("ignition", folder)
    files = [f"fuel: {header.description}", *layers, f"ignition: {lit.name}", f"outcome: {observed.name}"]
    if left := unread_files(folder, [each for name in (*KINDS, "weather") if (each := found(name, folder))]):
        files.append(f"files of {folder.name} that are not read: {', '.join(left)}")
    return FireCase(
        name=folder.name,
        landscape=landscape,
        cell_size=header.grid.cell_size,
        lit=torch.from_numpy(read_cells("ignition", lit, header.grid)),
        spells=spells_of(weather, last),
        minutes=outcome.minutes,
        burned=outcome.burned,
        arrival=outcome.arrival,
        files=files,
    )


@dataclass(frozen=True)
class Placed:
    """The part of a landscape that a wind reads to turn its bearings."""

    grid: Grid


def _weather(path: Path, units: Mapping[str, str] | None) -> WeatherTable:
    if not path.is_file():
        raise ValueError(f"weather must be {path.name} in {path.parent}, there is none")
    return read_weather(path, units=units)


def _end(rows: WeatherTable) -> float:
    """Return the minutes to the end of the last row, which lasts as long as the one before, or an hour."""
    lasts = float(rows.hours[-1] - rows.hours[-2]) if len(rows.hours) > 1 else 1.0
    return (float(rows.hours[-1]) + lasts) * 60.0


def _outcome(folder: Path, grid: Grid, hours: float | None, end: float) -> tuple[Outcome, Path]:
    """Return the cells that burned by known times, and their file; the end of the weather is in minutes."""
    last = end if hours is None else hours * 60.0
    path = found("perimeters", folder)
    if path is not None:
        return Outcome(*read_perimeters(path, grid, last, hours is not None)), path
    path = found("arrival", folder)
    if path is not None:
        return read_arrival(path, grid), path
    path = found("scar", folder)
    if path is None:
        raise ValueError(f"the outcome must be {_OUTCOMES} in {folder}, there is none")
    return read_scar(path, grid, last), path
