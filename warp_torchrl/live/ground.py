"""Ground of a world in three dimensions, constant during an episode.

One cell is one unit: x is east, y is north, z is up, and the middle of the map is at the origin. Heights are doubled.
"""

import math
from dataclasses import dataclass

import numpy as np
import torch
from torch import Tensor
from torch.nn.functional import avg_pool2d, pad

from warp_torchrl.live.shapes import Mesh
from warp_torchrl.world.state.state import Cover, WorldState

EXAGGERATION = 2.0
"""Of heights."""
MOST_TREES = 128 * 128
"""Cells of a map beyond which trees are colours of the ground, and no trees of their own."""


@dataclass(frozen=True)
class SceneGround:
    """Arrays that are constant during an episode.

    Attributes:
        height: Of each cell's middle, float32 [H, W] [cells].
        block: The ground as one closed body, under the tiles.
        position: Of the tiles, float32 [H W, 3] [cells], row by row.
        turn: Of the tiles, unit quaternion w, x, y, z, float32 [H W, 4].
        side: Of the tiles, float32 [H W]: longer on slopes, where they lie tilted over cells of side 1.
        trees: Flat index of the cells that have trees of their own, int64 [T]; none on large maps.
    """

    height: np.ndarray
    block: Mesh
    position: np.ndarray
    turn: np.ndarray
    side: np.ndarray
    trees: np.ndarray

    @property
    def size(self) -> tuple[int, int]:
        """Return (H, W) [cells]."""
        return self.height.shape[0], self.height.shape[1]


def ground_of(state: WorldState) -> SceneGround:
    """Return the ground of world 0."""
    elevation, (rows, columns) = state.landscape.elevation, state.cells.shape[1:]
    height = torch.zeros(rows, columns)
    if elevation is not None:
        height = (elevation[0] - elevation[0].mean()).float() * (EXAGGERATION / state.ground.cell_size)
    corners = avg_pool2d(pad(height[None], (1, 1, 1, 1), mode="replicate"), 2, stride=1)[0]
    middle = corners.unfold(0, 2, 1).unfold(1, 2, 1).mean((-2, -1))
    east = (corners[:, 1:] - corners[:, :-1]).unfold(0, 2, 1).mean(-1)
    south = (corners[1:] - corners[:-1]).unfold(1, 2, 1).mean(-1)
    x, y = _east_and_north(rows, columns)
    holds_trees = (state.cover[0] != int(Cover.LAKE)) & (state.cover[0] != int(Cover.BARE))
    trees = holds_trees.flatten().nonzero()[:, 0].numpy() if rows * columns <= MOST_TREES else np.zeros(0, np.int64)
    return SceneGround(
        height=middle.numpy(),
        block=_block(corners.numpy()),
        position=torch.stack((x.expand(rows, -1), y.expand(-1, columns), middle), dim=-1).flatten(0, 1).numpy(),
        turn=_tilt(east.flatten(), -south.flatten()).numpy(),
        side=(1.02 * (1.0 + east.square() + south.square()).sqrt()).flatten().numpy(),
        trees=trees,
    )


def cell_at(
    origin: tuple[float, float, float], direction: tuple[float, float, float], ground: SceneGround
) -> tuple[int, int] | None:
    """Return the (row, column) of the cell that a ray first meets from above; None if it meets none.

    Args:
        origin: Where it starts [cells].
        direction: Unit vector of where it goes; of any other it meets none.
        ground: The ground.
    """
    rows, columns = ground.size
    start, way = np.array(origin), np.array(direction)
    near, far = _within(start, way, ground)
    if not near < far:
        return None
    along = np.arange(near, far, 0.05)[:, None]
    x, y, z = (start + along * way).T
    row = np.floor((rows - 1) / 2.0 - y + 0.5).astype(int)
    column = np.floor(x + (columns - 1) / 2.0 + 0.5).astype(int)
    inside = (row >= 0) & (row < rows) & (column >= 0) & (column < columns)
    below = z <= ground.height[row.clip(0, rows - 1), column.clip(0, columns - 1)]
    met = np.flatnonzero(inside & below)
    return (int(row[met[0]]), int(column[met[0]])) if len(met) else None


def _within(start: np.ndarray, way: np.ndarray, ground: SceneGround) -> tuple[float, float]:
    """Return from where to where a ray is in the box around the ground [cells]: steps along it are as few as that."""
    if not abs(np.linalg.norm(way) - 1.0) < 0.01:
        return math.inf, 0.0
    rows, columns = ground.size
    low = np.array((-columns / 2.0, -rows / 2.0, ground.height.min() - 1.0))
    high = np.array((columns / 2.0, rows / 2.0, ground.height.max() + 1.0))
    with np.errstate(divide="ignore", invalid="ignore"):
        one, other = (low - start) / way, (high - start) / way
    return max(0.0, float(np.fmin(one, other).max())), float(np.fmax(one, other).min())


def _east_and_north(rows: int, columns: int) -> tuple[Tensor, Tensor]:
    """Return x of the columns [1, W] and y of the rows [H, 1] [cells]."""
    east = torch.arange(columns, dtype=torch.float32) - (columns - 1) / 2.0
    north = (rows - 1) / 2.0 - torch.arange(rows, dtype=torch.float32)
    return east[None], north[:, None]


def _tilt(east: Tensor, north: Tensor) -> Tensor:
    """Return the quaternions that tilt level tiles to slopes [n] of the ground, float32 [n, 4]."""
    up = torch.rsqrt(1.0 + east.square() + north.square())
    w = ((1.0 + up) / 2.0).sqrt()
    return torch.stack((w, north * up / (2.0 * w), -east * up / (2.0 * w), torch.zeros_like(w)), dim=1)


def _block(corners: np.ndarray) -> Mesh:
    """Return a closed body under a surface of corner heights [H + 1, W + 1], with its floor three cells below."""
    rows, columns = corners.shape
    floor = corners.min() - 3.0
    y, x = np.meshgrid((rows - 1) / 2.0 - np.arange(rows), np.arange(columns) - (columns - 1) / 2.0, indexing="ij")
    top = np.stack((x, y, corners - 0.06), axis=-1).reshape(-1, 3)
    number = np.arange(rows * columns).reshape(rows, columns)
    quads = np.stack((number[1:, :-1], number[1:, 1:], number[:-1, 1:], number[:-1, :-1]), axis=-1).reshape(-1, 4)
    rim = np.concatenate((number[0, :-1], number[:-1, -1], number[-1, :0:-1], number[:0:-1, 0]))
    below = top[rim].copy()
    below[:, 2] = floor
    low = len(top) + np.arange(len(rim))
    walls = np.stack((rim, np.roll(rim, -1), np.roll(low, -1), low), axis=-1)
    first, last = low[0], len(rim)
    bottom = np.stack((np.full(last - 2, first), low[1:-1], low[2:]), axis=-1)
    faces = np.concatenate((quads[:, [0, 1, 2]], quads[:, [0, 2, 3]], walls[:, [0, 1, 2]], walls[:, [0, 2, 3]], bottom))
    return Mesh(np.concatenate((top, below)).astype(np.float32), faces.astype(np.uint32))
