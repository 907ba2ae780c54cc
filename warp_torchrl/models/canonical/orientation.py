"""The eight symmetries of the square (the dihedral group D4), and their effect on vectors, planes and actions."""

from dataclasses import dataclass

import torch
from torch import Tensor

from warp_torchrl.entries import ADVICE, COMPASS, LAST
from warp_torchrl.system.modes import kept

_SYMMETRIES = 8


@dataclass(frozen=True, eq=False)
class Orientation:
    """One of the eight symmetries of the square for each map.

    Attributes:
        index: int64 [...]: the sum of 4 if rows are mirrored, 2 if columns are mirrored, and 1 if rows and columns
            change places after that; 0 changes nothing.
    """

    index: Tensor

    def offsets(self, offset: Tensor) -> Tensor:
        """Turn offsets (rows, columns) [..., 2]."""
        signed = offset * _signs(offset.device).to(offset.dtype)[self.index]
        return torch.where((self.index % 2 == 1)[..., None], signed.flip(-1), signed)

    def vectors(self, vector: Tensor) -> Tensor:
        """Turn vectors (east, north) [..., 2]."""
        east, north = vector.unbind(-1)
        south, east = self.offsets(torch.stack((-north, east), dim=-1)).unbind(-1)
        return torch.stack((east, -south), dim=-1)

    def planes(self, planes: Tensor) -> Tensor:
        """Turn square planes [..., C, S, S]."""
        cell = cells(planes.shape[-1], planes.device)[self.index].unsqueeze(-2).expand(*planes.shape[:-2], -1)
        return planes.flatten(-2).gather(-1, cell).view(planes.shape)

    def by_action(self, entries: Tensor, names: tuple[str, ...]) -> Tensor:
        """Turn entries [..., n] with one number per action, by the actions' names."""
        return entries.gather(-1, _actions(names, True, entries.device)[self.index])

    def by_action_back(self, entries: Tensor, names: tuple[str, ...]) -> Tensor:
        """Undo ``by_action``."""
        return entries.gather(-1, _actions(names, False, entries.device)[self.index])

    def action(self, action: Tensor, names: tuple[str, ...]) -> Tensor:
        """Turn actions, int64 [...]."""
        return _actions(names, False, action.device)[self.index, action]

    def units(self, features: Tensor) -> Tensor:
        """Turn features [..., 8 m] of the regular representation, m for each of the eight orientations.

        They change places as the orientations do: what was kept under one is found under the same when the map is
        seen in another.
        """
        return self._moved_units(features, _products(True, features.device)[self.index])

    def units_back(self, features: Tensor) -> Tensor:
        """Undo ``units``."""
        return self._moved_units(features, _products(False, features.device)[self.index])

    def _moved_units(self, features: Tensor, place: Tensor) -> Tensor:
        units = features.unflatten(-1, (_SYMMETRIES, -1))
        return units.gather(-2, place[..., None].expand(units.shape)).flatten(-2)


def orientation_to(offset: Tensor) -> Orientation:
    """Return the orientation in which each offset (rows, columns), int64 [..., 2], points between E and SE."""
    mirrored, size = (offset < 0).to(torch.int64), offset.abs()
    return Orientation(mirrored[..., 0] * 4 + mirrored[..., 1] * 2 + (size[..., 0] > size[..., 1]))


@kept(32)
def cells(side: int, device: torch.device) -> Tensor:
    """Return the flat index of the cell that each cell shows in each orientation, int64 [8, S S]."""
    cell = torch.arange(side * side).view(side, side)
    found = []
    for index, signs in enumerate(_signs(cell.device).tolist()):
        mirrored = cell.flip([axis for axis, sign in enumerate(signs) if sign < 0])
        found.append((mirrored.T if index % 2 else mirrored).flatten())
    return torch.stack(found).to(device)


@kept(8)
def _signs(device: torch.device) -> Tensor:
    """Return the sign of rows and columns in each orientation before they change places, int64 [8, 2]."""
    corner = torch.tensor([1, -1])
    return torch.cartesian_prod(corner, corner).repeat_interleave(2, dim=0).to(device)


@kept(8)
def _products(into: bool, device: torch.device) -> Tensor:
    """Return the orientation of the map for each orientation of a turned map, or back, int64 [8, 8]."""
    ways = Orientation(torch.arange(_SYMMETRIES)[:, None].expand(-1, 2))
    matrix = ways.offsets(torch.eye(2, dtype=torch.int64).expand(_SYMMETRIES, -1, -1))  # [way, of the map's axis, axis]
    product = torch.einsum("gij,kjl->gkil", matrix, matrix)
    same = (product[:, :, None] == matrix).flatten(-2).all(-1)
    way = same.to(torch.int64).argmax(-1)
    return (way if into else way.argsort(-1)).to(device)


@kept(32)
def _actions(names: tuple[str, ...], into: bool, device: torch.device) -> Tensor:
    """Return the index of each action on the map in each orientation, or back, int64 [8, n]."""
    compass = [COMPASS.get(name.removeprefix(LAST).removeprefix(ADVICE)) for name in names]
    moves = [place for place, offset in enumerate(compass) if offset is not None]
    index = torch.arange(len(names)).repeat(_SYMMETRIES, 1)
    if moves:
        offsets = torch.tensor([compass[place] for place in moves])
        turned = Orientation(torch.arange(_SYMMETRIES)[:, None].expand(-1, len(moves))).offsets(
            offsets.expand(_SYMMETRIES, -1, -1)
        )
        same = (turned[:, :, None] == offsets).all(-1).to(torch.int64)
        index[:, moves] = torch.tensor(moves)[same.argmax(-1)]
    return (index.argsort(-1) if into else index).to(device)
