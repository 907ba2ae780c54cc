"""Perimeters of a fire by hour, from GeoJSON (RFC 7946)."""

import json
from pathlib import Path
from typing import Any

import torch
from torch import Tensor

from warp_torchrl.world.terrain.grid import Grid

_WGS84 = "EPSG:4326"


def read_perimeters(path: Path, grid: Grid) -> tuple[Tensor, Tensor]:
    """Return what had burned by some times: cells whose middle lies in a perimeter.

    Each feature has ``minutes`` or ``hours`` since the ignition among its properties, and is a Polygon or MultiPolygon;
    features of one time are one. Coordinates are WGS84 longitude and latitude where the grid has a CRS, else the
    grid's. What burned stays burned.

    Returns:
        The times, float32 [K] [minutes], growing, and the cells, bool [K, H, W].

    Raises:
        ValueError: If the file is none of these, in one line.
    """
    by_time: dict[float, list[Any]] = {}
    for feature in _features(path):
        by_time.setdefault(_minutes(feature, path), []).append(feature["geometry"])
    times = sorted(by_time)
    cells = torch.stack([_inside(by_time[time], grid, path) for time in times])
    return torch.tensor(times), cells.to(torch.int8).cummax(0).values.to(torch.bool)


def _features(path: Path) -> list[dict[str, Any]]:
    try:
        content = json.loads(path.read_text(encoding="utf-8"))
        features = content["features"] if content["type"] == "FeatureCollection" else [content]
        kinds = {feature["geometry"]["type"] for feature in features}
    except (OSError, ValueError, KeyError, TypeError) as error:
        raise ValueError(f"{path.name} must be GeoJSON of polygons, it cannot be read: {error}") from None
    if not kinds or kinds - {"Polygon", "MultiPolygon"}:
        raise ValueError(f"{path.name} must hold polygons, got {', '.join(sorted(kinds)) or 'no feature'}")
    return list(features)


def _minutes(feature: dict[str, Any], path: Path) -> float:
    told = feature.get("properties") or {}
    value = told.get("minutes", 60.0 * told["hours"] if isinstance(told.get("hours"), int | float) else None)
    if not isinstance(value, int | float) or not 0.0 < value < 1e7:
        raise ValueError(f"{path.name} must have features with minutes or hours over 0, got {value!r}")
    return float(value)


def _inside(geometries: list[Any], grid: Grid, path: Path) -> Tensor:
    try:
        from rasterio.features import geometry_mask
        from rasterio.warp import transform_geom
    except ImportError:
        raise ValueError('perimeters must be read with rasterio: pip install "warp_torchrl[gis]"') from None
    if grid.crs:
        geometries = transform_geom(_WGS84, grid.crs, geometries)
    try:
        return torch.from_numpy(geometry_mask(geometries, grid.shape, grid.transform, invert=True))
    except (ValueError, TypeError) as error:
        raise ValueError(f"{path.name} must hold polygons: {' '.join(str(error).split())}") from None
