"""Grid convergence: the angle from true north, for weather's bearings, to a map's grid north, for fire.

bearing from grid north = bearing from true north - convergence
"""

import math

_STEP = 0.01
"""Half the length of the piece of a meridian that is looked at [degrees of latitude], about 1 km."""


def grid_convergence(crs: str, x: float, y: float) -> float:
    """Return the angle from true north to grid north at a place of a map [degrees, clockwise positive].

    East of the central meridian of a conic or UTM grid in the north, grid north lies clockwise of true north and the
    angle is positive.

    Args:
        crs: The map's coordinate reference system, in any form that rasterio reads: "EPSG:5070", WKT.
        x: Of the place, in the map's coordinates.
        y: The same.

    Raises:
        ValueError: If the system is not known, the place lies outside of it, or rasterio is missing.
    """
    try:
        from rasterio.warp import transform
    except ImportError:
        raise ValueError('crs must be read with rasterio, which is missing: pip install "warp_torchrl[gis]"') from None
    try:
        (east,), (north,) = transform(crs, "EPSG:4326", [x], [y])
        south_end, north_end = max(north - _STEP, -90.0), min(north + _STEP, 90.0)
        (x0, x1), (y0, y1) = transform("EPSG:4326", crs, [east, east], [south_end, north_end])
    except Exception as error:  # rasterio lets errors of GDAL through that have no public class
        raise ValueError(f"crs must be a system that knows the place ({x:g}, {y:g}), got {crs!r}: {error}") from None
    return -math.degrees(math.atan2(x1 - x0, y1 - y0))
