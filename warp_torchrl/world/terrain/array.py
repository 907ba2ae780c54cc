"""Landscapes from a user's arrays, passed directly or in an ``.npz`` file."""

import math
import zipfile
from collections.abc import Sequence
from dataclasses import dataclass, field
from hashlib import sha256
from math import prod
from os import PathLike
from pathlib import Path
from typing import Any, Literal

import numpy as np
from torch import Tensor

from warp_torchrl.validation import check_fields
from warp_torchrl.world.state.state import OLDEST, Cover
from warp_torchrl.world.terrain.crop import Crop, Cropped, check_crowns
from warp_torchrl.world.terrain.landscape import DENSEST, TALLEST
from warp_torchrl.world.terrain.layer import LARGEST_MAP
from warp_torchrl.world.terrain.planes import HIGHEST, LOWEST
from warp_torchrl.world.terrain.source import map_size

LAYER_TYPES = {
    "cover": np.uint8,
    "elevation": np.float32,
    "age": np.uint8,
    "assets": np.float32,
    "fuel": np.int16,
    "canopy_cover": np.float32,
    "canopy_height": np.float32,
    "canopy_base_height": np.float32,
    "canopy_bulk_density": np.float32,
}
"""The arrays of a landscape, and the type that each is kept in."""
_WHOLE = {"cover": (0, int(max(Cover))), "age": (0, OLDEST), "fuel": (-32768, 32767)}
"""Those of whole numbers, and their ranges."""
_REAL = {
    "elevation": (LOWEST, HIGHEST, f"finite and in [{LOWEST:g}, {HIGHEST:g}] m"),
    "assets": (0.0, math.inf, "finite and 0 or more"),
    "canopy_cover": (0.0, 100.0, "in [0, 100]"),
    "canopy_height": (0.0, TALLEST, f"in [0, {TALLEST:g}]"),
    "canopy_base_height": (0.0, TALLEST, f"in [0, {TALLEST:g}]"),
    "canopy_bulk_density": (0.0, DENSEST, f"in [0, {DENSEST:g}]"),
}
"""The others, and their ranges, in words too."""


@dataclass(frozen=True, kw_only=True)
class Array(Cropped):
    """A landscape from arrays: cover, and optionally elevation, tree age, fuel and canopy.

    Two are equal where their layers, window and cell size are, wherever the layers come from.

    Attributes:
        path: An ``.npz`` file with ``cover`` [H, W] of codes 0..4, and optionally the other arrays below by their
            names; or None where the arrays are passed.
        cover: Land cover codes [H, W], anything ``numpy.asarray`` takes.
        elevation: In metres, [H, W]; None makes a flat world.
        age: Tree age 0..10 [H, W]; None leaves it to ``ages``.
        ages: Ages if ``age`` is None: ``drawn`` draws the trees' ages for each episode, as the paper does; ``oldest``
            gives all the oldest, 10, so that every cell of fuel can burn, as on real ground.
        assets: Worth of each cell [H, W], 0 or more in any unit, for rewards that use it; None leaves all alike.
        fuel: Class codes of a fuel model [H, W], which laws of rates of spread read; None leaves them to the cover.
        canopy_cover: Canopy cover [%], [H, W], and
        canopy_height: height of the canopy's top [m], [H, W], by which such laws slow the wind down; None: not known.
        canopy_base_height: Height of the crowns' base [m], [H, W], and
        canopy_bulk_density: what burns in crowns [kg/m3], [H, W], by which fires run in crowns; None: not known.
        size: Side of the world, or (rows, columns) [cells]: a window of the array. None, or the array's shape,
            takes the whole array, whatever its fuel.
        row: Top row of the window in the array. None, with ``column``, draws a window for each episode.
        column: Left column of the window in the array.
        min_fuel: Lowest share of a drawn window where trees can stand, so that there is something to burn.
        cell_size: Side of a cell [m].

    Raises:
        ValueError: If there is no cover, arrays and a path are both given, the file is missing, damaged or enormous,
            shapes differ, a value is out of its range, ``ages`` is ``oldest`` beside ages, a layer by which crowns
            burn lacks the others, or no window fits.
    """

    path: str | PathLike[str] | None = field(default=None, compare=False)
    cover: Sequence[Sequence[int]] | np.ndarray | Tensor | None = field(default=None, repr=False, compare=False)
    elevation: Sequence[Sequence[float]] | np.ndarray | Tensor | None = field(default=None, repr=False, compare=False)
    age: Sequence[Sequence[int]] | np.ndarray | Tensor | None = field(default=None, repr=False, compare=False)
    ages: Literal["drawn", "oldest"] = "drawn"
    assets: Sequence[Sequence[float]] | np.ndarray | Tensor | None = field(default=None, repr=False, compare=False)
    fuel: Sequence[Sequence[int]] | np.ndarray | Tensor | None = field(default=None, repr=False, compare=False)
    canopy_cover: Sequence[Sequence[float]] | np.ndarray | Tensor | None = field(
        default=None, repr=False, compare=False
    )
    canopy_height: Sequence[Sequence[float]] | np.ndarray | Tensor | None = field(
        default=None, repr=False, compare=False
    )
    canopy_base_height: Sequence[Sequence[float]] | np.ndarray | Tensor | None = field(
        default=None, repr=False, compare=False
    )
    canopy_bulk_density: Sequence[Sequence[float]] | np.ndarray | Tensor | None = field(
        default=None, repr=False, compare=False
    )
    size: tuple[int, int] | int | None = None
    row: int | None = None
    column: int | None = None
    min_fuel: float = 0.5
    cell_size: float = 30.0
    _digest: str = field(init=False)  # of the layers: arrays cannot be compared by ==, nor shown

    def __post_init__(self) -> None:
        check_fields(self, min_fuel=(0.0, 1.0), cell_size=(0.01, 100_000.0))
        if self.size is not None:
            map_size(self.size)
        layers = {name: getattr(self, name) for name in LAYER_TYPES if getattr(self, name) is not None}
        if self.path is not None and layers:
            raise ValueError(f"path must be null where arrays are passed, got {self.path} and {', '.join(layers)}")
        layers = layers if self.path is None else read_npz(self.path, tuple(LAYER_TYPES))
        if "cover" not in layers:
            raise ValueError(f"path must name an .npz file with cover where cover is not passed, got {self.path}")
        layers = {name: _check_layer(name, layer) for name, layer in layers.items()}
        shape = layers["cover"].shape
        for name, layer in layers.items():
            if layer.shape != shape:
                raise ValueError(f"{name} must have the shape of cover {shape}, got {layer.shape}")
        check_crowns(tuple(layers), ("canopy_cover", "canopy_height"))
        if self.ages == "oldest" and "age" in layers:
            raise ValueError("ages must be drawn where age is given, which tells them, got oldest")
        if self.ages == "oldest":
            layers["age"] = np.full(shape, OLDEST, np.uint8)
        size = map_size(shape if self.size is None else self.size)
        row, column = (0 if size == shape and each is None else each for each in (self.row, self.column))
        object.__setattr__(self, "size", size)
        object.__setattr__(self, "_crop", Crop(**layers, size=size, row=row, column=column, min_fuel=self.min_fuel))
        object.__setattr__(self, "_digest", _digest(layers))


def read_npz(path: str | PathLike[str], names: tuple[str, ...]) -> dict[str, np.ndarray]:
    """Return the arrays of an ``.npz`` file that have these names, without pickle.

    Raises:
        ValueError: If it cannot be read; if it is enormous, from its header.
    """
    try:
        if not Path(path).is_file():
            raise FileNotFoundError("there is no such file")
        with zipfile.ZipFile(path) as archive:
            shapes = {name: _read_shape(archive, name) for name in names if f"{name}.npy" in archive.namelist()}
        largest = max(map(prod, shapes.values()), default=0)
        if largest <= LARGEST_MAP:
            with np.load(path, allow_pickle=False) as layers:
                return {name: layers[name] for name in shapes}
    except Exception as error:  # damage shows in a dozen classes, of zip, deflate, numpy's header and its parser
        reason = " ".join(str(error).split())
        raise ValueError(f"path must name an .npz file of plain arrays, {path} is not one: {reason}") from None
    raise ValueError(f"path must name arrays of at most {LARGEST_MAP} cells, {path} declares {largest}")


def _read_shape(archive: zipfile.ZipFile, name: str) -> tuple[int, ...]:
    with archive.open(f"{name}.npy") as member:
        version = np.lib.format.read_magic(member)
        old = version == (1, 0)
        return (np.lib.format.read_array_header_1_0 if old else np.lib.format.read_array_header_2_0)(member)[0]


def _check_layer(name: str, layer: Any) -> np.ndarray:
    """Return a layer in the type that it is kept in."""
    try:
        values = np.asarray(layer)
    except (TypeError, ValueError, RuntimeError) as error:  # ragged rows; a tensor of another device
        reason = " ".join(str(error).split())
        raise ValueError(f"{name} must be an array of numbers, got {type(layer).__name__}: {reason}") from None
    if values.dtype.kind not in "buif" or values.ndim != 2:
        got = f"{values.dtype} of shape {values.shape}"
        raise ValueError(f"{name} must hold numbers in two dimensions, rows and columns, got {got}")
    if name in _WHOLE:
        lowest, highest = _WHOLE[name]
        broken = ~((values >= lowest) & (values <= highest) & (values == np.round(values)))
        rule = f"hold whole numbers in {lowest}..{highest}"
    else:
        low, high, words = _REAL[name]
        broken = ~((np.abs(values) <= np.finfo(np.float32).max) & (values >= low) & (values <= high))
        rule = f"be {words} everywhere"
    if broken.any():
        raise ValueError(f"{name} must {rule}, got {values[broken][0]}")
    return values.astype(LAYER_TYPES[name])


def _digest(layers: dict[str, np.ndarray]) -> str:
    digest = sha256()
    for name, layer in layers.items():
        digest.update(f"{name} {layer.shape}".encode() + layer.tobytes())
    return digest.hexdigest()
