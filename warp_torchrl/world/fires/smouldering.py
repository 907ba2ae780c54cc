"""Embers that smoulder, by when they start fires."""

import torch
from torch import Tensor

from warp_torchrl.world.backends.spreading import chosen

_AHEAD = 16  # times as far as the next asked time, within which embers are looked through each time


class Smouldering:
    """A list of embers, of which those that are due soon stand apart: a tick looks through them alone."""

    def __init__(self) -> None:
        none = torch.zeros(0, dtype=torch.int64)
        self._soon = self._late = (none, none, torch.zeros(0))
        self._until, self._asked = 0.0, 0.0  # what is due until then is soon; the last time that was asked for

    def __len__(self) -> int:
        return len(self._soon[0]) + len(self._late[0])

    def add(self, fire: Tensor, cell: Tensor, minutes: Tensor) -> None:
        """Add embers: of which fire, int64 [n], in which cell, int64 [n], and when they start fires, float32 [n]."""
        soon, late = _parted(self._until, (fire, cell, minutes))
        self._soon, self._late = _joined(self._soon, soon), _joined(self._late, late)

    def due(self, end: float) -> tuple[Tensor, Tensor, Tensor]:
        """Return those that are due until a time [minutes], and forget them."""
        if end > self._until:
            self._until = end + _AHEAD * max(0.0, end - self._asked)
            soon, self._late = _parted(self._until, self._late)
            self._soon = _joined(self._soon, soon)
        self._asked = end
        due, self._soon = _parted(end, self._soon)
        return due


_Embers = tuple[Tensor, Tensor, Tensor]


def _parted(end: float, embers: _Embers) -> tuple[_Embers, _Embers]:
    """Return those that are due until a time, and the others."""
    due = embers[2] <= end
    (fire, cell, minutes), others = chosen(due, *embers), chosen(~due, *embers)
    return (fire, cell, minutes), (others[0], others[1], others[2])


def _joined(one: _Embers, other: _Embers) -> _Embers:
    return torch.cat((one[0], other[0])), torch.cat((one[1], other[1])), torch.cat((one[2], other[2]))
