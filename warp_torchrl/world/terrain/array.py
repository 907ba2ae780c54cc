"""Landscapes from arrays that a user has: passed as they are, or from an ``.npz`` file."""

import math
import zipfile
from collections.abc import Sequence
from dataclasses import dataclass, field
from hashlib import sha256
from math import prod
from os import PathLike
from pathlib import Path
from typing import Any

import numpy as np
from torch import Tensor

from warp_torchrl.validation import check_fields
from warp_torchrl.world.state import OLDEST, Cover, Landscape
from warp_torchrl.world.terrain.crop import Crop
from warp_torchrl.world.terrain.landscape import map_size
from warp_torchrl.world.terrain.layer import LARGEST_MAP

LAYERS = {"cover": np.uint8, "elevation": np.float32, "age": np.uint8, "assets": np.float32}
"""The arrays of a landscape, and the type that each is kept in."""


@dataclass(frozen=True, kw_only=True)
class Array:
    """A landscape that the user has: cover, and optionally elevation and tree age.

    Two are equal where their layers, window and cell size are, wherever the layers come from.

    Attributes:
        path: An ``.npz`` file with ``cover`` [H, W] of codes 0..4, and optionally ``elevation`` [m], ``age`` 0..10 and
            ``assets``; or None where the arrays are passed.
        cover: Land cover codes [H, W], anything ``numpy.asarray`` takes.
        elevation: In metres, [H, W]; None makes a flat world.
        age: Tree age [H, W]; None draws it for each episode.
        assets: What each cell is worth [H, W], 0 or more in any unit, for rewards that ask; None leaves all alike.
        size: Side of the world, or (rows, columns) [cells]: a window of the array. None, or the array's own shape,
            takes the whole array, whatever its fuel.
        row: Top row of the window in the array. None, with ``column``, draws a window for each episode.
        column: Left column of the window in the array.
        min_fuel: Lowest share of a drawn window where trees can stand, so that there is something to burn.
        cell_size: Side of a cell [m].

    Raises:
        ValueError: If there is no cover, arrays and a path are both given, the file is missing, damaged or enormous,
            shapes differ, a code is not in 0..4, an age not in 0..10, an elevation not finite, or no window fits.
    """

    path: str | PathLike[str] | None = field(default=None, compare=False)
    cover: Sequence[Sequence[int]] | np.ndarray | Tensor | None = field(default=None, repr=False, compare=False)
    elevation: Sequence[Sequence[float]] | np.ndarray | Tensor | None = field(default=None, repr=False, compare=False)
    age: Sequence[Sequence[int]] | np.ndarray | Tensor | None = field(default=None, repr=False, compare=False)
    assets: Sequence[Sequence[float]] | np.ndarray | Tensor | None = field(default=None, repr=False, compare=False)
    size: tuple[int, int] | int | None = None
    row: int | None = None
    column: int | None = None
    min_fuel: float = 0.5
    cell_size: float = 30.0
    _crop: Crop = field(init=False, repr=False, compare=False)
    _digest: str = field(init=False, repr=False)  # of the layers: arrays cannot be compared by ==

    def __post_init__(self) -> None:
        check_fields(self, min_fuel=(0.0, 1.0), cell_size=(0.01, 100_000.0))
        if self.size is not None:
            map_size(self.size)
        layers = {name: getattr(self, name) for name in LAYERS if getattr(self, name) is not None}
        if self.path is not None and layers:
            raise ValueError(f"path must be null where arrays are passed, got {self.path} and {', '.join(layers)}")
        layers = layers if self.path is None else read_npz(self.path, tuple(LAYERS))
        if "cover" not in layers:
            raise ValueError(f"path must name an .npz file with cover where cover is not passed, got {self.path}")
        layers = {name: _check_layer(name, layer) for name, layer in layers.items()}
        shape = layers["cover"].shape
        for name, layer in layers.items():
            if layer.shape != shape:
                raise ValueError(f"{name} must have the shape of cover {shape}, got {layer.shape}")
        size = map_size(shape if self.size is None else self.size)
        row, column = (0 if size == shape and each is None else each for each in (self.row, self.column))
        object.__setattr__(self, "size", size)
        object.__setattr__(self, "_crop", Crop(**layers, size=size, row=row, column=column, min_fuel=self.min_fuel))
        object.__setattr__(self, "_digest", _digest(layers))

    def __call__(self, key: Tensor) -> Landscape:
        """Return the landscape of each world's window, batch size [B]."""
        return self._crop(key)

    @property
    def extent(self) -> tuple[int, int]:
        """Return (rows, columns) of the whole array."""
        return self._crop.extent

    def reach(self) -> np.ndarray:
        """Return where a world may lie, bool [rows, columns]."""
        return self._crop.reach()


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
    if name in ("elevation", "assets"):
        lowest = 0.0 if name == "assets" else -math.inf
        broken = ~((np.abs(values) <= np.finfo(np.float32).max) & (values >= lowest))
        if broken.any():
            rule = "finite and 0 or more" if name == "assets" else "finite"
            raise ValueError(f"{name} must be {rule} everywhere, got {values[broken][0]}")
    else:
        highest = max(Cover) if name == "cover" else OLDEST
        broken = ~((values >= 0) & (values <= highest) & (values == np.round(values)))
        if broken.any():
            raise ValueError(f"{name} must hold whole numbers in 0..{highest:d}, got {values[broken][0]}")
    return values.astype(LAYERS[name])


def _digest(layers: dict[str, np.ndarray]) -> str:
    digest = sha256()
    for name, layer in layers.items():
        digest.update(f"{name} {layer.shape}".encode() + layer.tobytes())
    return digest.hexdigest()
