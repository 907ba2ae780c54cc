"""Winds from a user's arrays, an ``.npz`` file or rasters, steady or changing in time."""

from collections.abc import Sequence
from copy import copy
from dataclasses import dataclass, field
from os import PathLike
from pathlib import Path
from typing import Any, Literal

import numpy as np
import torch
from torch import Tensor

from warp_torchrl.validation import check_fields
from warp_torchrl.world.air.wind import Wind
from warp_torchrl.world.state.state import WorldState
from warp_torchrl.world.terrain.array import read_npz
from warp_torchrl.world.terrain.bands import DEGREES, SPEED_UNITS, factor_of
from warp_torchrl.world.terrain.grid import Grid, check_grid
from warp_torchrl.world.terrain.layer import Header, find_layer, read_header, read_layer
from warp_torchrl.world.terrain.resampling import resample
from warp_torchrl.world.terrain.source import LandscapeSource, map_size

STRONGEST = 120.0
"""Largest component of a wind that is believed [m/s]."""
Numbers = Sequence[Any] | np.ndarray | Tensor


@dataclass(frozen=True, kw_only=True, eq=False)
class Gridded(Wind):
    """A wind field on the landscape's map; each world has the window of its ground.

    Attributes:
        path: An ``.npz`` file with ``u`` and ``v``; or a folder of raster layers; None where arrays are passed.
        u: East component [m/s], [rows, columns] or in time [T, rows, columns]; or, in a folder, the file name of its
            layer or a pattern that one raster matches.
        v: The same for the north component [m/s].
        speed: Pattern of a layer of wind speeds [m/s], which with ``bearing`` stands for ``u`` and ``v``, as WindNinja
            and weather services write them; None reads ``u`` and ``v``.
        bearing: Pattern of a layer of directions from which the wind blows [degrees clockwise from north].
        ticks_per_field: Ticks that each field of a series in time lasts; the last stays for good.
        resample: Layers on another grid than the landscape's: ``refuse`` makes them an error, ``bilinear`` interpolates
            u and v.

    Raises:
        ValueError: If there is no wind, a layer is missing, damaged or on another grid, or a component is not in
            [-120, 120] m/s where it is known.
    """

    path: str | PathLike[str] | None = None
    u: str | Numbers = field(default="*_u.*", repr=False)
    v: str | Numbers = field(default="*_v.*", repr=False)
    speed: str | None = None
    bearing: str | None = None
    ticks_per_field: int = 1
    resample: Literal["refuse", "bilinear"] = "refuse"
    _fields: np.ndarray = field(init=False, repr=False)  # float32 [T, rows, columns, 2], NaN where not known
    _grid: Grid | None = field(init=False, repr=False)
    _maps: dict[torch.device, Tensor] = field(init=False, repr=False)

    def __post_init__(self) -> None:
        check_fields(self, ticks_per_field=(1, 1_000_000))
        if (self.speed is None) != (self.bearing is None):
            raise ValueError(f"bearing must be given with speed, got {self.bearing} and {self.speed}")
        grid: Grid | None = None
        u: str | Numbers | None = self.u
        v: str | Numbers | None = self.v
        if self.path is not None and Path(self.path).is_dir():
            grid, u, v = self._read_layers(Path(self.path))
        elif self.path is not None:
            layers = read_npz(self.path, ("u", "v"))
            u, v = layers.get("u"), layers.get("v")
        if u is None or v is None or isinstance(u, str) or isinstance(v, str):
            raise ValueError(f"path must name a folder of rasters or an .npz file with u and v, got {self.path}")
        self._keep(grid, _stack(u, v))

    @property
    def changes(self) -> bool:
        """Return whether there is more than one field in time."""
        return len(self._fields) > 1

    def over(self, landscape: LandscapeSource) -> "Gridded":
        """Return this wind on the landscape's map.

        Raises:
            ValueError: If its shape or grid is another and it may not be resampled, or it is not known where a world
                may lie.
        """
        ground, wind = getattr(landscape, "grid", None), self
        if self._grid is not None and ground is not None and self._grid.differs_in(ground):
            if self.resample == "refuse":
                check_grid("wind", self._grid, "the landscape", ground)
            wind = copy(self)
            wind._keep(ground, np.stack([self._resampled(part, self._grid, ground) for part in (0, 1)], axis=-1)[None])
        extent = getattr(landscape, "extent", None) or map_size(landscape.size)
        if wind._fields.shape[1:3] != extent:
            shape = list(wind._fields.shape[1:3])
            raise ValueError(f"wind must have the shape of the landscape's map, {list(extent)}, got {shape}")
        unknown = np.isnan(wind._fields).any(axis=(0, 3))
        lacking = unknown & (landscape.reach() if hasattr(landscape, "reach") else True)
        if lacking.any():
            raise ValueError(f"wind must be known wherever a world may lie, it is not in {int(lacking.sum())} cells")
        return wind

    def __call__(self, key: Tensor, size: tuple[int, int], corner: Tensor | None = None) -> Tensor:
        """Return the first field of each world's window, float32 [B, 2, H, W] [m/s]."""
        return self._window(torch.zeros_like(key), size, corner)

    def after_tick(self, state: WorldState) -> Tensor:
        """Return the field that follows each world's tick number ``state.tick``, float32 [B, 2, H, W] [m/s]."""
        index = (state.tick.to(torch.int64) // self.ticks_per_field).clamp(max=len(self._fields) - 1)
        return self._window(index, state.cells.shape[1:], state.landscape.corner)

    def _window(self, index: Tensor, size: Sequence[int], corner: Tensor | None) -> Tensor:
        device = index.device
        if device not in self._maps:
            self._maps[device] = torch.from_numpy(self._fields).to(device)
        corner = torch.zeros(len(index), 2, dtype=torch.int64, device=device) if corner is None else corner
        row = corner[:, :1] + torch.arange(size[0], device=device)
        column = corner[:, 1:] + torch.arange(size[1], device=device)
        field = self._maps[device][index[:, None, None], row[:, :, None], column[:, None, :]]
        return field.movedim(-1, 1).contiguous()

    def _keep(self, grid: Grid | None, fields: np.ndarray) -> None:
        object.__setattr__(self, "_grid", grid)
        object.__setattr__(self, "_fields", fields)
        object.__setattr__(self, "_maps", {})

    def _resampled(self, part: int, own: Grid, ground: Grid) -> np.ndarray:
        values = self._fields[0, ..., part]
        values, known = resample("wind", values, ~np.isnan(values), own, ground, "bilinear")
        return np.where(known, values, np.nan).astype(np.float32)

    def _read_layers(self, folder: Path) -> tuple[Grid, np.ndarray, np.ndarray]:
        """Return the grid of the layers and u and v on it; NaN where they are not known."""
        polar = self.speed is not None
        names: dict[str, Any] = {"speed": self.speed, "bearing": self.bearing} if polar else {"u": self.u, "v": self.v}
        paths = {name: find_layer(name, folder, pattern) for name, pattern in names.items()}
        headers = {name: read_header(name, path, self.resample == "refuse") for name, path in paths.items()}
        first, second = names
        check_grid(second, headers[second].grid, first, headers[first].grid)
        one, other = (_read_unit(name, header, polar and name == second) for name, header in headers.items())
        return headers[first].grid, *(_to_components(one, other) if polar else (one, other))


def _read_unit(name: str, header: Header, is_bearing: bool) -> np.ndarray:
    """Return a layer in metres per second or degrees, NaN where it is not known, by its file's unit."""
    values, known = read_layer(name, header.path, header.number)
    factor = factor_of(name, header.path, header.unit, DEGREES if is_bearing else SPEED_UNITS)
    return np.where(known, values * factor if factor != 1.0 else values, np.nan)


def _to_components(speed: np.ndarray, bearing: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Return u and v of a wind from a bearing, degrees clockwise from north."""
    angle = np.radians(bearing)
    return -speed * np.sin(angle), -speed * np.cos(angle)


def _stack(u: Numbers, v: Numbers) -> np.ndarray:
    """Return the fields, float32 [T, rows, columns, 2]; NaN where a component is not known."""
    parts = {"u": np.asarray(u), "v": np.asarray(v)}
    for name, part in parts.items():
        if part.dtype.kind not in "uif" or part.ndim not in (2, 3) or 0 in part.shape:
            got = f"{part.dtype} of shape {part.shape}"
            raise ValueError(f"{name} must hold numbers in [rows, columns] or [T, rows, columns], got {got}")
        if (np.abs(part) > STRONGEST).any():
            raise ValueError(
                f"{name} must be in [-{STRONGEST:g}, {STRONGEST:g}] m/s, got {part[np.abs(part) > STRONGEST][0]}"
            )
    if parts["u"].shape != parts["v"].shape:
        raise ValueError(f"v must have the shape of u, {parts['u'].shape}, got {parts['v'].shape}")
    fields = np.stack(list(parts.values()), axis=-1).astype(np.float32)
    fields = fields if fields.ndim == 4 else fields[None]
    return np.where(np.isnan(fields).any(axis=-1, keepdims=True), np.float32(np.nan), fields)
