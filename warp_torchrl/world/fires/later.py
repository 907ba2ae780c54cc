"""Later ignitions of fires without vehicles."""

import torch
from torch import Tensor

from warp_torchrl.world.backends.growing import Caught, Embers


class LaterFires:
    """Later ignitions in each of some fires, beside those by embers.

    Args:
        minutes: When each cell is lit, float32 [H, W], in minutes since the start; infinite where it is not.
        fires: How many fires, B.
        embers: What else starts fires ahead; None: nothing.
    """

    def __init__(self, minutes: Tensor, fires: int, embers: Embers | None = None) -> None:
        flat = minutes.flatten()
        cell = (flat > 0.0).logical_and(flat.isfinite()).nonzero()[:, 0]
        order = flat[cell].argsort(stable=True)
        self._cell, self._minutes, self._fires, self._embers = cell[order], flat[cell][order], fires, embers

    @property
    def smoulder(self) -> bool:
        """Return whether any cell is still to be lit."""
        return bool(len(self._cell)) or (self._embers is not None and self._embers.smoulder)

    def due(self, end: float) -> tuple[Tensor, Tensor, Tensor]:
        """See ``Embers``."""
        count = int((self._minutes <= end).sum())
        cell, minutes = self._cell[:count], self._minutes[:count]
        self._cell, self._minutes = self._cell[count:], self._minutes[count:]
        own = torch.arange(self._fires).repeat_interleave(count), cell.repeat(self._fires), minutes.repeat(self._fires)
        if self._embers is None:
            return own
        fire, flown, then = (torch.cat(each) for each in zip(own, self._embers.due(end), strict=True))
        return fire, flown, then

    def thrown(self, number: int, caught: Caught) -> None:
        """See ``Embers``."""
        if self._embers is not None:
            self._embers.thrown(number, caught)
