"""Files of a real fire in its folder, by their names."""

from pathlib import Path

from warp_torchrl.world.terrain.crop import CROWN_LAYERS
from warp_torchrl.world.terrain.features import SUFFIXES
from warp_torchrl.world.terrain.layer import RASTERS

NAMES = {"fuel": "fuel.tif or fuel.asc", "ignition": "ignition.csv, .tif, .asc, .geojson or .shp"}
KINDS = {
    "fuel": tuple(RASTERS),
    **dict.fromkeys(("elevation", "canopy_cover", "canopy_height", *CROWN_LAYERS), tuple(RASTERS)),
    "ignition": (".csv", *RASTERS, *SUFFIXES),
    "perimeters": SUFFIXES,
    "arrival": tuple(RASTERS),
    "scar": (*RASTERS, *SUFFIXES),
}
"""Suffixes of the files that each part of a fire may be."""


def only(name: str, folder: Path) -> Path:
    """Return the only file of a name in a folder.

    Raises:
        ValueError: If there is none, or several.
    """
    path = found(name, folder)
    if path is None:
        raise ValueError(f"{name} must be {NAMES[name]} in {folder}, there is none")
    return path


def found(name: str, folder: Path) -> Path | None:
    """Return the only file of a name in a folder; None without one.

    Raises:
        ValueError: If there are several.
    """
    there = [path for kind in KINDS.get(name, ()) if (path := folder / f"{name}{kind}").is_file()]
    if len(there) > 1:
        raise ValueError(f"{name} must be one file in {folder}, got {', '.join(path.name for path in there)}")
    return there[0] if there else None
