"""A real fire: its ground, weather and ignition, and the cells known to have burned by known times."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path

import torch
from torch import Tensor

from warp_torchrl.prediction.calibration.null_models import mean_wind
from warp_torchrl.prediction.calibration.observed import Outcome, read_arrival, read_perimeters, read_scar
from warp_torchrl.world.air.weather import Weather
from warp_torchrl.world.fires.spell import Spell, spells_of
from warp_torchrl.world.state.state import OLDEST, Cover, Landscape
from warp_torchrl.world.terrain.cells import read_cells
from warp_torchrl.world.terrain.features import SUFFIXES
from warp_torchrl.world.terrain.fuel import is_code
from warp_torchrl.world.terrain.grid import Grid, check_grid
from warp_torchrl.world.terrain.layer import RASTERS, Header, read_header, read_layer
from warp_torchrl.world.terrain.layers import elevation_unit, unread_files
from warp_torchrl.world.terrain.planes import check_slopes, to_fuel, to_metres
from warp_torchrl.world.terrain.resampling import fill
from warp_torchrl.world.weather.table import WeatherTable, read_weather

_OUTCOMES = "scar (.tif, .asc, .geojson, .shp), arrival (.tif, .asc) or perimeters (.geojson, .shp)"
_NAMES = {"fuel": "fuel.tif or fuel.asc", "ignition": "ignition.csv, .tif, .asc, .geojson or .shp"}
_KINDS = {
    "fuel": tuple(RASTERS),
    "elevation": tuple(RASTERS),
    "ignition": (".csv", *RASTERS, *SUFFIXES),
    "perimeters": SUFFIXES,
    "arrival": tuple(RASTERS),
    "scar": (*RASTERS, *SUFFIXES),
}
"""Suffixes of the files that each part of a fire may be."""
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


def read_fire_case(folder: str | Path, hours: float | None = None, units: Mapping[str, str] | None = None) -> FireCase:
    """Read a fire from a folder.

    It holds ``fuel`` and, unless the ground is level, ``elevation``, each a GeoTIFF (.tif) or an ESRI ASCII grid
    (.asc); ``weather.csv``, whose first row holds when the fire starts; ``ignition``, any file that ``read_cells``
    reads; and the outcome: ``perimeters`` (GeoJSON or a shapefile), or a raster ``arrival`` [minutes from the start],
    or a ``scar``, a raster over 0 where it burned by the last hour, GeoJSON or a shapefile. Cells without fuel data do
    not burn; elevation that is not known is that of the cells around.

    Args:
        folder: The folder.
        hours: When a scar, or perimeters without a time, are known [h]; None is the end of the weather, whose last row
            lasts as the one before.
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
    fuel = _only("fuel", folder)
    header = read_header("fuel", fuel, remedy=_REMEDY)
    rows = _weather(folder / "weather.csv", units)
    weather, end = Weather(table=rows).over(_Placed(header.grid)), _end(rows)  # type: ignore[arg-type]
    outcome, observed = _outcome(folder, header.grid, hours, end)
    last = float(outcome.minutes[-1])
    if last > end + 1e-3:
        got = f"{last / 60.0:g}"
        raise ValueError(f"the outcome must be known in hours of the weather, {end / 60.0:g}, got {got}")
    landscape, elevation = _landscape(folder, header)
    lit = _only("ignition", folder)
    files = [f"fuel: {header.description}", *elevation, f"ignition: {lit.name}", f"outcome: {observed.name}"]
    if left := unread_files(folder, [each for name in (*_KINDS, "weather") if (each := _found(name, folder))]):
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
class _Placed:
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


def _landscape(folder: Path, header: Header) -> tuple[Landscape, list[str]]:
    """Return the ground, and the source of its elevation."""
    codes, known = read_layer("fuel", header.path, header.number)
    fuel = to_fuel(codes, known & is_code(codes, {}))
    cover = torch.full((1, *header.grid.shape), int(Cover.FOREST), dtype=torch.uint8)
    path = _found("elevation", folder)
    elevation, told = (
        (None, ["elevation: none, the ground is level"]) if path is None else _elevation(path, header.grid)
    )
    ground = Landscape(cover=cover, age=torch.full_like(cover, OLDEST), elevation=elevation)
    return ground.with_layers(fuel=torch.from_numpy(fuel)[None]), told


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


def _outcome(folder: Path, grid: Grid, hours: float | None, end: float) -> tuple[Outcome, Path]:
    """Return the cells that burned by known times, and their file; the end of the weather is in minutes."""
    last = end if hours is None else hours * 60.0
    path = _found("perimeters", folder)
    if path is not None:
        return Outcome(*read_perimeters(path, grid, last, hours is not None)), path
    path = _found("arrival", folder)
    if path is not None:
        return read_arrival(path, grid), path
    path = _found("scar", folder)
    if path is None:
        raise ValueError(f"the outcome must be {_OUTCOMES} in {folder}, there is none")
    return read_scar(path, grid, last), path


def _only(name: str, folder: Path) -> Path:
    path = _found(name, folder)
    if path is None:
        raise ValueError(f"{name} must be {_NAMES[name]} in {folder}, there is none")
    return path


def _found(name: str, folder: Path) -> Path | None:
    """Return the only file of a name in a folder; None without one.

    Raises:
        ValueError: If there are several.
    """
    there = [path for kind in _KINDS.get(name, ()) if (path := folder / f"{name}{kind}").is_file()]
    if len(there) > 1:
        raise ValueError(f"{name} must be one file in {folder}, got {', '.join(path.name for path in there)}")
    return there[0] if there else None
