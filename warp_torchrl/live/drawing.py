"""A world as the arrays of a picture in three dimensions; no loop over cells, and nothing of a browser.

Places are those of ``ground``.
"""

from dataclasses import dataclass
from functools import lru_cache

import numpy as np
import torch
from torch import Tensor
from torch.nn.functional import avg_pool2d

from warp_torchrl.env.pictures.colours import HOUSE, LOST, fire_colours
from warp_torchrl.live.ground import SceneGround
from warp_torchrl.world.arrays.geometry import unit_vectors
from warp_torchrl.world.state.cells import is_burning, is_tree
from warp_torchrl.world.state.state import FIRST_FIRE, WorldState
from warp_torchrl.world.team.presence import those_there

VEHICLE_COLOURS = np.array(  # Okabe and Ito 2008, on the dark sides of a vehicle; then again from the first
    [(255, 255, 255), (230, 159, 0), (86, 180, 233), (240, 228, 66), (204, 121, 167), (0, 158, 115), (213, 94, 0),
     (0, 114, 178)],
    dtype=np.uint8,
)  # fmt: skip
"""Of the vehicles, by their index, uint8 [8, 3]."""
_FLIGHT = 3.0  # height of aircraft over the ground [cells]
_GLOW_SIDE = 9  # of the square in which fires shine together [cells]
_WIND_ARROWS = 5  # along each side of the map
_SPARKS = 3  # over a burning cell
_SHADE = 0.82  # of the ground under trees


@dataclass(frozen=True)
class Instances:
    """Copies of one shape.

    Attributes:
        position: Of each, float32 [n, 3] [cells].
        turn: Of each, unit quaternion w, x, y, z, float32 [n, 4].
        scale: Of each, along x, y and z, float32 [n, 3].
        colour: Of each, uint8 [n, 3].
    """

    position: np.ndarray
    turn: np.ndarray
    scale: np.ndarray
    colour: np.ndarray


def tiles(state: WorldState, ground: SceneGround, cells: Tensor) -> np.ndarray:
    """Return the colours of the tiles of world 0, uint8 [H W, 3]: those of its cells, darker under trees.

    Args:
        state: The worlds.
        ground: Of world 0.
        cells: Colour of each cell, uint8 [H, W, 3].
    """
    colours = cells.flatten(0, 1)
    if not len(ground.trees):
        return colours.numpy()
    under = is_tree(state.cells[0]).flatten()[:, None]
    return torch.where(under, (colours.float() * _SHADE).byte(), colours).numpy()


def trees(state: WorldState, ground: SceneGround, cells: Tensor) -> Instances:
    """Return the trees of world 0: one for each cell of ``ground.trees``, with size 0 where the cell has no tree.

    A tree's height shows its age. Its colour is that of its cell. The arguments are those of ``tiles``.
    """
    codes = state.cells[0].flatten()[ground.trees]
    age = torch.where(is_burning(codes), state.age[0].flatten()[ground.trees], codes).float()
    jitter = _jitter(ground.size)[ground.trees]
    tall = torch.where(age > 0, 0.45 + 0.1 * age, 0.0) * (0.85 + 0.3 * torch.from_numpy(jitter[:, 2]))
    wide = tall.clamp(max=1.0) * 0.95
    colour = cells.flatten(0, 1)[ground.trees].float()
    light = 0.88 + 0.24 * torch.from_numpy(jitter[:, 3:])
    position = ground.position[ground.trees] + np.pad(0.3 * (jitter[:, :2] - 0.5), ((0, 0), (0, 1)))
    return Instances(
        position=position.astype(np.float32),
        turn=_upright(len(codes)),
        scale=torch.stack((wide, wide, tall), dim=1).numpy(),
        colour=(colour * light).clamp(max=255.0).byte().numpy(),
    )


def houses(left: Tensor, ground: SceneGround) -> Instances:
    """Return a house for each cell of world 0 where something stands, lower and darker the less is left of it.

    Args:
        left: Of ``Mechanic.buildings``.
        ground: Of world 0.
    """
    share = left[0].flatten().cpu()
    index = (share >= 0.0).nonzero()[:, 0]
    share = share[index, None].float()
    colour = torch.tensor(LOST).float().lerp(torch.tensor(HOUSE).float(), share)
    side = torch.full_like(share, max(1.5, max(ground.size) / 36.0))
    return Instances(
        position=ground.position[index.numpy()],
        turn=_upright(len(index)),
        scale=torch.cat((side, side, side * (0.4 + 0.6 * share)), dim=1).numpy(),
        colour=colour.round().byte().numpy(),
    )


def flames(state: WorldState, ground: SceneGround) -> Instances:
    """Return a flame for each burning cell of world 0, its colour by stage; they flicker from step to step."""
    cells = state.cells[0].flatten()
    index = is_burning(cells).nonzero()[:, 0].numpy()
    stage = cells[index].long() - FIRST_FIRE
    jitter = np.roll(_jitter(ground.size), int(state.step[0]) * 7, axis=0)[index]
    tall = np.array([1.1, 1.9, 2.3, 1.7, 0.7], dtype=np.float32)[stage.numpy()] * (0.75 + 0.5 * jitter[:, 2])
    wide = np.minimum(tall, 1.4) * 0.9
    return Instances(
        position=ground.position[index],
        turn=_upright(len(index)),
        scale=np.stack((wide, wide, tall), axis=1).astype(np.float32),
        colour=fire_colours()[stage].numpy(),
    )


def smoke_puffs(state: WorldState, ground: SceneGround) -> Instances:
    """Return puffs over the burning cells of world 0, carried by the wind; a third of them at a time."""
    index = is_burning(state.cells[0]).flatten().nonzero()[:, 0].numpy()
    jitter = np.roll(_jitter(ground.size), int(state.step[0]) * 3, axis=0)[index]
    some = jitter[:, 0] < 0.34
    index, jitter = index[some], jitter[some]
    rise = 2.0 + 5.0 * jitter[:, 1:2]
    drift = _wind_at(state, index) * rise * 0.12
    size = (0.6 + 0.2 * rise) * (0.8 + 0.4 * jitter[:, 2:3])
    grey = (150.0 + 60.0 * jitter[:, 3:]).astype(np.uint8)
    return Instances(
        position=(ground.position[index] + np.concatenate((drift, rise), axis=1)).astype(np.float32),
        turn=_upright(len(index)),
        scale=np.repeat(size, 3, axis=1).astype(np.float32),
        colour=np.repeat(grey, 3, axis=1),
    )


def sparks(state: WorldState, ground: SceneGround) -> tuple[np.ndarray, np.ndarray]:
    """Return sparks that rise with the wind from the burning cells of world 0.

    Returns:
        Their places, float32 [n, 3] [cells], and colours, uint8 [n, 3]: those of fire, darker higher up.
    """
    index = is_burning(state.cells[0]).flatten().nonzero()[:, 0].numpy().repeat(_SPARKS)
    draws = np.random.default_rng(int(state.step[0]))
    x, y, height = draws.random((3, len(index)), dtype=np.float32)
    rise = 0.6 + 4.4 * height[:, None] ** 2
    drift = _wind_at(state, index) * rise * 0.12
    spread = np.stack((x, y), axis=1) - 0.5
    colours = fire_colours().float().numpy()
    share = np.sqrt(height)[:, None]
    return (
        (ground.position[index] + np.concatenate((spread + drift, rise), axis=1)).astype(np.float32),
        (colours[0] * (1.0 - share) + colours[2] * share).astype(np.uint8),
    )


def glow(state: WorldState, ground: SceneGround) -> tuple[tuple[float, float, float], float]:
    """Return where the light of the fires of world 0 comes from, over the densest of them [cells], and its strength."""
    burning = is_burning(state.cells[:1]).float()
    around = avg_pool2d(burning, _GLOW_SIDE, stride=1, padding=_GLOW_SIDE // 2)[0] * burning[0]
    place = int(around.argmax())
    x, y, z = ground.position[place].tolist()
    return (x, y, z + 4.0), 90.0 * float(around.flatten()[place].sqrt())


def vehicles(state: WorldState, ground: SceneGround, flies: Tensor, facing: Tensor) -> Instances:
    """Return the vehicles of world 0; absent ones have no size.

    Args:
        state: The worlds.
        ground: Of world 0.
        flies: Which of them are aircraft, bool [A].
        facing: Direction of each, int64 [A]: 0..7 clockwise from north; -1 is east.
    """
    place = state.vehicles.position[0]
    index = (place[:, 0] * ground.size[1] + place[:, 1]).numpy()
    position = ground.position[index] + np.array([0.0, 0.0, 1.0]) * (flies.numpy()[:, None] * _FLIGHT + 0.05)
    size = np.full((len(index), 3), max(1.25, max(ground.size) / 42.0), dtype=np.float32)
    size *= those_there(state, torch.ones_like(place[None, :, 0], dtype=torch.bool))[0, :, None].numpy()
    half = _angles(facing) / 2.0
    zero = torch.zeros_like(half)
    return Instances(
        position=position.astype(np.float32),
        turn=torch.stack((half.cos(), zero, zero, half.sin()), dim=1).numpy(),
        scale=size,
        colour=VEHICLE_COLOURS[np.arange(len(index)) % len(VEHICLE_COLOURS)],
    )


def headings(shown: Instances, goals: dict[int, tuple[int, int]], ground: SceneGround) -> np.ndarray:
    """Return where vehicles are heading as lines from each to its end, float32 [A, 2, 3] [cells].

    Args:
        shown: Of ``vehicles``.
        goals: (row, column) of the place that a vehicle was sent to, by its index; others point where they face.
        ground: Of world 0.
    """
    size, turn = shown.scale[:, :1], 2.0 * np.arctan2(shown.turn[:, 3], shown.turn[:, 0])
    ahead = np.stack((np.cos(turn), np.sin(turn), np.zeros_like(turn)), axis=1)
    start = shown.position + np.array([0.0, 0.0, 0.55]) * size
    end = start + ahead * 2.4 * size
    for agent, (row, column) in goals.items():
        end[agent] = ground.position[row * ground.size[1] + column] + (0.0, 0.0, 0.6)
    return np.stack((start + ahead * 0.9 * size, end), axis=1).astype(np.float32)


def wind_arrows(state: WorldState, ground: SceneGround) -> np.ndarray:
    """Return the wind of world 0 as arrows over the map where the air goes, float32 [25, 2, 3] [cells].

    An arrow of a wind of 12 m/s is as long as their distance. In a calm all are points.
    """
    rows, columns = ground.size
    row = ((torch.arange(_WIND_ARROWS) + 0.5) * rows / _WIND_ARROWS).long()
    column = ((torch.arange(_WIND_ARROWS) + 0.5) * columns / _WIND_ARROWS).long()
    index = (row[:, None] * columns + column).flatten().numpy()
    middle = ground.position[index].copy()
    middle[:, 2] = ground.height.max() + max(rows, columns) / 8.0
    reach = _wind_at(state, index) * (min(rows, columns) / _WIND_ARROWS / 12.0)
    half = np.pad(reach, ((0, 0), (0, 1))) / 2.0
    return np.stack((middle - half, middle + half), axis=1).astype(np.float32)


# Parts


def _upright(count: int) -> np.ndarray:
    turn = np.zeros((count, 4), dtype=np.float32)
    turn[:, 0] = 1.0
    return turn


@lru_cache(maxsize=4)
def _jitter(size: tuple[int, int]) -> np.ndarray:
    """Return numbers of each cell that make trees look grown and not set, float32 [H W, 4] in 0..1, always the same."""
    return np.random.default_rng(0).random((size[0] * size[1], 4), dtype=np.float32)


def _angles(direction: Tensor) -> Tensor:
    """Return the angle from east, counter-clockwise, of directions, float32 [A] [radians]; 0 of those below 0."""
    units = unit_vectors()[direction.clamp(min=0)]
    return torch.where(direction >= 0, torch.atan2(units[:, 1], units[:, 0]), 0.0)


def _wind_at(state: WorldState, index: np.ndarray) -> np.ndarray:
    """Return the wind of world 0 at flat indices [n], float32 [n, 2], (u east, v north) [m/s]."""
    field = state.wind[0].expand(-1, *state.cells.shape[1:]).flatten(1)
    return field[:, index].T.numpy()
