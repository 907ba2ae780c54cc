"""The maps of a prediction as files: GeoTIFF, GeoJSON, PNG and GIF."""

import math
from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from pathlib import Path

import numpy as np
import torch
from torch import Tensor

from warp_torchrl.env.pictures.maps import MapPanel, save_maps
from warp_torchrl.prediction.predict import CROWN_MAPS, Prediction
from warp_torchrl.system import disk, memory
from warp_torchrl.world.terrain.geotiff import write_geotiff
from warp_torchrl.world.terrain.grid import Grid
from warp_torchrl.world.terrain.perimeter import perimeters, write_geojson

MAPS_FIGURE, ARRIVALS = "maps.png", "arrivals.tif"
_UNITS = {
    "burn_probability": "",
    "arrival_hours": "h",
    "rate": "m/min",
    "intensity": "kW/m",
    "flame_length": "m",
    "crown": "",
}


@dataclass(frozen=True, eq=False)
class MapPlace:
    """Where a map lies: a window of a grid."""

    grid: Grid
    corner: tuple[int, int] = (0, 0)  # (row, column) of the first cell in the grid


def layers(prediction: Prediction) -> Iterator[tuple[str, dict[str, Tensor]]]:
    """Yield each GeoTIFF's name and its bands, one after the other; times in hours."""
    yield "burn_probability", {"burn_probability": prediction.burn_probability}
    yield (
        "arrival_hours",
        {
            "median": prediction.arrival_minutes / 60.0,
            "early_10": prediction.arrival_early / 60.0,
            "late_90": prediction.arrival_late / 60.0,
            "half": prediction.half_minutes / 60.0,
        },
    )
    yield "rate", {"rate_m_min": prediction.rate}
    yield "intensity", {"intensity_kw_m": prediction.intensity}
    yield "flame_length", {"flame_length_m": prediction.flame_length}
    if prediction.has_crowns:
        yield "crown", {name: getattr(prediction, name) for name in CROWN_MAPS}


def write_layers(folder: Path, prediction: Prediction, place: MapPlace) -> list[str]:
    """Write the GeoTIFFs of ``layers`` and return their names.

    Raises:
        ValueError: If rasterio is not installed.
        OSError: If a write fails, with the path.
    """
    names = []
    for name, bands in layers(prediction):
        write_geotiff(folder / f"{name}.tif", bands, place.grid, place.corner, _UNITS[name])
        names.append(f"{name}.tif")
    return names


def write_arrivals(path: Path, prediction: Prediction, place: MapPlace) -> None:
    """Write when each fire of a prediction came [h], on the whole map, a band for each.

    Raises:
        ValueError: If the maps of all fires do not fit in memory, or rasterio is not installed.
        OSError: If the write fails, with the path.
    """
    window, every = prediction.window, prediction.every
    if every is None:
        raise ValueError("prediction must keep the times of every fire, predict(keep_every=True), got none")
    wanted, there = 12.0 * len(every) * math.prod(window.map), memory.available()
    if wanted > there:
        raise memory.too_little(f"the times of {len(every)} fires on the whole map", wanted, there)
    bands = {
        f"fire {number}": window.put(times / 60.0, torch.full(window.map, torch.nan))
        for number, times in enumerate(every)
    }
    write_geotiff(path, bands, place.grid, place.corner, "h")


def write_perimeters(path: Path, prediction: Prediction, place: MapPlace, every: float) -> None:
    """Write, as GeoJSON, the outlines of the cells that half of the fires had reached at multiples of ``every`` hours.

    Raises:
        ValueError: If rasterio is not installed.
        OSError: If the write fails, with the path.
    """
    longest = float(prediction.followed.max()) / 60.0
    times = [every * 60.0 * step for step in range(1, int(longest / every + 1e-6) + 1)]
    if not times or times[-1] < longest * 60.0 - 1e-3:
        times.append(longest * 60.0)
    window = prediction.window
    corner = place.corner[0] + window.top, place.corner[1] + window.left
    write_geojson(path, perimeters(prediction.seen["half_minutes"], place.grid, times, corner))


def write_figure(path: Path, prediction: Prediction, title: str) -> None:
    """Draw the maps beside the ground: of a map that is larger than the fires' window, what the window has.

    Raises:
        ImportError: If Matplotlib is not installed.
        OSError: If the write fails, with the path.
    """
    with disk.with_path(path):
        ground, lit = prediction.ground_seen, prediction.window.cut(prediction.lit, False)
        save_maps(path, ground, panels(prediction), prediction.cell_size, title, lit)


def panels(prediction: Prediction) -> list[MapPanel]:
    """Return the panels of the figure; colours of rates and intensities end at their 99th percentile."""
    maps = prediction.seen
    amounts: Mapping[str, tuple[Tensor, str]] = {
        "arrival, median": (maps["arrival_minutes"] / 60.0, "hours since the start"),
        "rate of spread": (maps["rate"], "m/min"),
        "fireline intensity": (maps["intensity"], "kW/m"),
        "flame length": (maps["flame_length"], "m"),
    }
    seen = maps["burn_probability"].masked_fill(maps["burn_probability"] == 0.0, torch.nan)
    if prediction.has_crowns:
        amounts = {**amounts, "crown fire": (maps["crown_fire"], "share of the fires that came")}
    chance = MapPanel(
        title=f"burn probability, {len(prediction.followed)} fires", values=seen, label="share of the fires"
    )
    return [chance, *(MapPanel(title=name, values=each, label=label, kind="amount", top=_top(each))
                      for name, (each, label) in amounts.items())]  # fmt: skip


def _top(values: Tensor) -> float | None:
    known = values[~values.isnan()].numpy()
    return float(np.percentile(known, 99.0)) or None if len(known) else None
