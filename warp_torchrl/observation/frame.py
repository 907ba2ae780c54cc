"""Frames: how one may hold the map, so that what is learnt of a fire on one side is known of all.

The fire's law is the same on a map that is turned or mirrored (with its wind), and so is what a team should do. Whoever
reads observations may hold each turned and mirrored so that the fire that it shows lies between the east and the
south-east, and say what to do in the same terms: what is learnt of one case then holds for all eight (canonical inputs,
as in Kaba et al., "Equivariance with learned canonicalization functions", 2023, with a rule in place of the learnt
function). A frame is told by the observation alone, so agents that use one are as decentralised as any.
"""

import math
from collections.abc import Mapping
from dataclasses import dataclass
from functools import lru_cache

import torch
from torch import Tensor

from warp_torchrl.observation.channels import DEFAULT, FIRE
from warp_torchrl.observation.coarse import PICTURE, PICTURE_SIDE, STATE
from warp_torchrl.observation.own import IDENTITY_SIZE, LAST_ACTION, PLACE, SELF, SELF_SIZE, WIND
from warp_torchrl.world.geometry import DIRECTIONS

FIRE_CHANNEL = DEFAULT.index(FIRE)
"""Which channel of a view tells where fire is, unless others are chosen."""
NEAR_CELLS, NEAR_BLOCKS = 2.0, 0.5
"""Distance that is added to that of a fire, so that those at hand count alike [cells of a view, blocks of a map]."""
_PARTS = 2.0**16
"""Pulls are whole numbers of such parts: sums are exact in any order, so that a tie is a tie in any batch."""
_SYMMETRIES = 8


@dataclass(frozen=True, eq=False)
class Frame:
    """How maps are held, one of the eight symmetries of the square each.

    Attributes:
        index: int64 [...]: 4 where rows are mirrored, and 2 where columns are, and 1 where rows and columns change
            places after that.
    """

    index: Tensor

    def vectors(self, vector: Tensor) -> Tensor:
        """Return vectors (rows, columns) [..., 2] of the map as they are in the frame."""
        signed = vector * _signs(vector.device).to(vector.dtype)[self.index]
        return torch.where((self.index % 2 == 1)[..., None], signed.flip(-1), signed)

    def maps(self, maps: Tensor) -> Tensor:
        """Return square maps [..., C, S, S] as they are in the frame."""
        cell = _cells(maps.shape[-1], maps.device)[self.index].unsqueeze(-2).expand(*maps.shape[:-2], -1)
        return maps.flatten(-2).gather(-1, cell).view(maps.shape)

    def actions(self, entries: Tensor) -> Tensor:
        """Return an entry for each action on the map [..., actions] in the order of what they are in the frame."""
        return entries.gather(-1, _actions(True, entries.shape[-1], entries.device)[self.index])

    def action(self, action: Tensor) -> Tensor:
        """Return what actions on the map, int64 [...], are in the frame."""
        n_moves = len(DIRECTIONS)
        move = _actions(False, n_moves, action.device)[self.index, action.clamp(max=n_moves - 1)]
        return torch.where(action < n_moves, move, action)

    def units(self, features: Tensor) -> Tensor:
        """Return features [..., 8 m], m for each of the eight ways to hold the map, as they are in the frame.

        They change places as the ways do: what was kept of the map under one is found under the same when the map is
        held in another.
        """
        return self._moved_units(features, _products(True, features.device)[self.index])

    def units_on_map(self, features: Tensor) -> Tensor:
        """Undo ``units``."""
        return self._moved_units(features, _products(False, features.device)[self.index])

    def _moved_units(self, features: Tensor, place: Tensor) -> Tensor:
        units = features.unflatten(-1, (_SYMMETRIES, -1))
        return units.gather(-2, place[..., None].expand(units.shape)).flatten(-2)

    def actions_on_map(self, entries: Tensor) -> Tensor:
        """Undo ``actions``."""
        return entries.gather(-1, _actions(False, entries.shape[-1], entries.device)[self.index])


def can_be_held(shapes: Mapping[str, tuple[int, ...]], own_names: tuple[str, ...] = ()) -> bool:
    """Return whether observations are of a preset that shows the fire.

    Args:
        shapes: Of the entries, by name.
        own_names: Names of the numbers of ``self``, which tell it where a team has further roles or actions.
    """
    sides = {name: shape[-1] for name, shape in shapes.items()}
    if set(shapes) == {""}:
        side = math.isqrt(sides[""] // 3)
        return sides[""] == 3 * side * side and side % 2 == 1
    if set(shapes) not in ({"view", "self"}, {"view", "self", "picture"}):
        return False
    pictures = {(len(PICTURE), side, side) for side in (PICTURE_SIDE, 2 * PICTURE_SIDE - 1)}
    return (
        shapes["view"][1:] == (sides["view"], sides["view"])
        and (sides["self"] in (SELF_SIZE, SELF_SIZE + IDENTITY_SIZE) or own_names[:SELF_SIZE] == SELF)
        and shapes.get("picture", (len(PICTURE), PICTURE_SIDE, PICTURE_SIDE)) in pictures
    )


def frame_of(observation: Mapping[str, Tensor], fire: int = FIRE_CHANNEL) -> Frame:
    """Return how agents hold the map so that the fire that they see lies between their east and their south-east.

    Where it lies is told by the view where that shows any, else by the picture: by the sum of the offsets to what
    burns, each over (its Chebyshev distance + a little)^3.

    Args:
        observation: Entries of a preset, batch dimensions first, by name.
        fire: Which channel of the view tells where fire is.

    Returns:
        Frames [...] of the batch dimensions.
    """
    view = observation["view"] if "view" in observation else _planes(observation[""])
    near = view[..., fire if "view" in observation else -1, :, :] > 0
    pull = _pull(near, NEAR_CELLS)
    if "picture" in observation:
        seen = near.flatten(-2).any(-1)[..., None]
        pull = torch.where(seen, pull, _pull_of_picture(observation["picture"], observation["self"]))
    return _facing(pull)


def held(name: str, entry: Tensor, frame: Frame) -> Tensor:
    """Return an entry of an observation, batch dimensions first, as it is in the frame."""
    if name == "self":
        place, clock, wind, others, last, more = entry.split([*_SELF_PARTS, entry.shape[-1] - sum(_SELF_PARTS)], dim=-1)
        place, wind, last = frame.vectors(place - 0.5) + 0.5, _wind(wind, frame), frame.actions(last)
        return torch.cat((place, clock, wind, others, last, more), dim=-1)
    return frame.maps(_planes(entry)).flatten(-3) if name == "" else frame.maps(entry)


def held_state(state: Tensor) -> Tensor:
    """Return the critic's states [..., C, 16, 16] as the middle of the team holds them, facing the fire.

    The box that holds all fire and all agents is in the middle of the planes, so that where it is on the map makes no
    difference; off the map there is nothing.
    """
    side = state.shape[-1]
    team = state[..., _AGENTS, :, :].sum(-3)
    along = torch.arange(side, device=state.device) + 0.5
    place = torch.stack([(each * along).sum(-1) for each in (team.sum(-1), team.sum(-2))], dim=-1)
    frame = _facing(_pull_from(place / team.sum((-2, -1))[..., None], state[..., _FIRE, :, :]))
    happening = (state[..., _FIRE, :, :] > 0) | (team > 0)
    start = _corner(frame.maps(happening[..., None, :, :])[..., 0, :, :])
    shown = _shown(state, frame, start)
    quarters = state[..., -1, :, :].unflatten(-1, (2, side // 2)).unflatten(-3, (2, side // 2))
    clock, wind = quarters[..., 0, 0, :, 0], quarters[..., 1, 0, :, 0]
    constants = torch.stack((clock, _wind(wind, frame)), dim=-2)[..., :, None, :, None]
    shown[..., -1, :, :] = constants.expand_as(quarters).reshape(state[..., -1, :, :].shape)
    return shown


def _corner(marked: Tensor) -> Tensor:
    """Return the row and column, int64 [..., 2], from which on a map shows the box of what is marked in its middle.

    Args:
        marked: bool [..., S, S].
    """
    side = marked.shape[-1]
    along = torch.arange(side, device=marked.device)
    found = []
    for lines in (marked.any(-1), marked.any(-2)):
        first = torch.where(lines, along, side).amin(-1)
        last = torch.where(lines, along, -1).amax(-1)
        found.append((first + last + 1) // 2 - side // 2)
    return torch.stack(found, dim=-1)


def _shown(maps: Tensor, frame: Frame, start: Tensor) -> Tensor:
    """Return maps [..., C, S, S] as they are in the frame from the row and column ``start`` on, int64 [..., 2].

    Off the map there is 0.
    """
    side = maps.shape[-1]
    lines = start[..., None] + torch.arange(side, device=maps.device)
    row, column = lines.clamp(0, side - 1).unbind(-2)
    in_frame = (row[..., :, None] * side + column[..., None, :]).flatten(-2)
    cell = _cells(side, maps.device)[frame.index].gather(-1, in_frame)
    shown = maps.flatten(-2).gather(-1, cell.unsqueeze(-2).expand(*maps.shape[:-2], -1)).view(maps.shape)
    down, across = ((lines >= 0) & (lines < side)).unbind(-2)
    return shown.mul_((down[..., :, None] & across[..., None, :]).unsqueeze(-3))


_FIRE = STATE.index("fire")
_AGENTS = slice(STATE.index("ugv"), STATE.index("elevation") - len(STATE))  # further roles stand beside these
_SELF_PARTS = [
    PLACE.stop,
    WIND.start - PLACE.stop,
    WIND.stop - WIND.start,
    LAST_ACTION.start - WIND.stop,
    LAST_ACTION.stop - LAST_ACTION.start,
]


def _wind(wind: Tensor, frame: Frame) -> Tensor:
    """Return winds (east, north) [..., 2] as they are in the frame."""
    east, north = wind.unbind(-1)
    south, east = frame.vectors(torch.stack((-north, east), dim=-1)).unbind(-1)
    return torch.stack((east, -south), dim=-1)


def _facing(pull: Tensor) -> Frame:
    """Return the frames in which pulls (rows, columns), int64 [..., 2], point between east and south-east."""
    mirrored, size = (pull < 0).to(torch.int64), pull.abs()
    return Frame(mirrored[..., 0] * 4 + mirrored[..., 1] * 2 + (size[..., 0] > size[..., 1]))


def _pull(fire: Tensor, near: float) -> Tensor:
    """Return which way fire pulls whoever is in the middle of it, int64 [..., 2], of whole numbers [..., S, S]."""
    return (fire.flatten(-2).to(torch.float64) @ _units(fire.shape[-1], near, fire.device)).to(torch.int64)


def _pull_of_picture(picture: Tensor, own: Tensor) -> Tensor:
    """Return which way the fire of pictures [..., 3, S, S] pulls, int64 [..., 2]; ``own`` tells where agents are."""
    fire = picture[..., PICTURE.index("fire"), :, :]
    if fire.shape[-1] == PICTURE_SIDE:
        return _pull_from(own[..., PLACE] * PICTURE_SIDE, fire)
    return _pull(fire, NEAR_BLOCKS)


def _pull_from(place: Tensor, fire: Tensor) -> Tensor:
    """Return which way fire in blocks, float32 [..., S, S], pulls from places [blocks] [..., 2], int64 [..., 2]."""
    side = fire.shape[-1]
    along = torch.arange(side, device=fire.device) + 0.5
    down, across = along - place[..., :1], along - place[..., 1:]
    distance = torch.maximum(down.abs()[..., :, None], across.abs()[..., None, :]) + NEAR_BLOCKS
    weight = fire * _PARTS / (distance * distance * distance)
    pulls = weight * down[..., :, None], weight * across[..., None, :]
    return torch.stack([each.round().to(torch.int64).sum((-2, -1)) for each in pulls], dim=-1)


def _planes(entry: Tensor) -> Tensor:
    """Return the planes of a flat view, [..., 3, V, V]."""
    side = math.isqrt(entry.shape[-1] // 3)
    return entry.unflatten(-1, (3, side, side))


@lru_cache(maxsize=16)
def _units(side: int, near: float, device: torch.device) -> Tensor:
    """Return how fire at each cell about the middle pulls, whole numbers, float64 [S S, 2]."""
    along = torch.arange(side, dtype=torch.float64) - side // 2
    away = torch.cartesian_prod(along, along)
    return (away * _PARTS / (away.abs().amax(-1, keepdim=True) + near) ** 3).round().to(device)


@lru_cache(maxsize=8)
def _signs(device: torch.device) -> Tensor:
    """Return what each frame does to rows and columns before they change places, 1 or -1, int64 [8, 2]."""
    corner = torch.tensor([1, -1])
    return torch.cartesian_prod(corner, corner).repeat_interleave(2, dim=0).to(device)


@lru_cache(maxsize=32)
def _cells(side: int, device: torch.device) -> Tensor:
    """Return the flat index of what each cell of a map shows in each frame, int64 [8, S S]."""
    cell = torch.arange(side * side).view(side, side)
    found = []
    for index, signs in enumerate(_signs(cell.device).tolist()):
        mirrored = cell.flip([axis for axis, sign in enumerate(signs) if sign < 0])
        found.append((mirrored.T if index % 2 else mirrored).flatten())
    return torch.stack(found).to(device)


@lru_cache(maxsize=8)
def _products(in_frame: bool, device: torch.device) -> Tensor:
    """Return which way of holding the map each one is of a map that is held in a frame, or back, int64 [8, 8]."""
    ways = Frame(torch.arange(_SYMMETRIES)[:, None].expand(-1, 2))
    matrix = ways.vectors(torch.eye(2, dtype=torch.int64).expand(_SYMMETRIES, -1, -1))  # [way, of the map's axis, axis]
    product = torch.einsum("gij,kjl->gkil", matrix, matrix)
    same = (product[:, :, None] == matrix).flatten(-2).all(-1)
    way = same.to(torch.int64).argmax(-1)
    return (way if in_frame else way.argsort(-1)).to(device)


@lru_cache(maxsize=16)
def _actions(in_frame: bool, count: int, device: torch.device) -> Tensor:
    """Return which action on the map each one in a frame is, or the other way round, int64 [8, count]."""
    moves = torch.tensor(DIRECTIONS)
    frames = Frame(torch.arange(_SYMMETRIES)[:, None].expand(-1, len(moves)))
    turned = frames.vectors(moves.expand(_SYMMETRIES, -1, -1))
    index = (turned[:, :, None] == moves).all(-1).to(torch.int64).argmax(-1)  # of each move on the map
    index = index.argsort(-1) if in_frame else index
    others = torch.arange(len(moves), count).expand(_SYMMETRIES, -1)
    return torch.cat((index, others), dim=-1).to(device)
