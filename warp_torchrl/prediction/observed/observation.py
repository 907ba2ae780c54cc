"""An observation of a fire: what has burned by a time."""

from dataclasses import dataclass
from typing import Literal

import torch
from torch import Tensor
from torch.nn.functional import max_pool2d, pad

from warp_torchrl.world.fires.sightings import HotSpotSensor

_FEWEST = 3  # hot spots of a group that is apart from the fire: fewer may be false alarms
_GAP = 2  # pixels between hot spots of one group


@dataclass(frozen=True, kw_only=True, eq=False)
class Observation:
    """Cells that were seen to burn or to have burned.

    Attributes:
        minutes: Since the fires' start.
        kind: ``perimeter``: what has burned; ``hot_spots``: what is hot.
        cells: The cells inside the perimeter, or those in which hot spots lie, bool [H, W].
    """

    minutes: float
    kind: Literal["perimeter", "hot_spots"]
    cells: Tensor

    def burned(self, known: Tensor, sensor: HotSpotSensor, side: int) -> Tensor:
        """Return what has burned by then, bool [H, W].

        Of hot spots these are the pixels about them, with gaps closed that are no wider than a pixel. Groups of fewer
        than three hot spots that are apart from what had burned are taken for false alarms.

        Args:
            known: What had burned by the observation before, bool [H, W].
            sensor: The satellite.
            side: Of a pixel [cells].
        """
        if self.kind == "perimeter":
            return known | self.cells
        hot = _of_groups(self.cells, known, side)
        closed = ~_about(~_about(hot, 2 * side), side)
        return known | (closed & _about(hot, 2 * side))


def _about(cells: Tensor, side: int) -> Tensor:
    """Return the squares of some cells' side about each cell, bool [H, W]."""
    reach = side // 2
    return max_pool2d(cells[None, None].float(), 2 * reach + 1, 1, reach)[0, 0] > 0.0


def _of_groups(hot: Tensor, known: Tensor, side: int) -> Tensor:
    """Return hot cells that are near to the fire, or in groups of three pixels at least, bool [H, W]."""
    pixels, fire = (
        max_pool2d(pad(each.float(), _past(each, side))[None, None], side)[0, 0] > 0.0 for each in (hot, known)
    )
    reach = 2 * _GAP + 1
    kept, left = torch.zeros_like(pixels), pixels.clone()
    near = _about(fire, reach)
    while bool(left.any()):
        group = torch.zeros_like(pixels)
        group.view(-1)[int(left.flatten().to(torch.uint8).argmax())] = True
        while not torch.equal(wider := _about(group, reach) & pixels, group):
            group = wider
        if int(group.sum()) >= _FEWEST or bool((group & near).any()):
            kept |= group
        left &= ~group
    cells = kept.repeat_interleave(side, 0).repeat_interleave(side, 1)
    return hot & cells[: hot.shape[0], : hot.shape[1]]


def _past(cells: Tensor, side: int) -> tuple[int, int, int, int]:
    """Return the padding that fills a map's last pixels."""
    return 0, -cells.shape[1] % side, 0, -cells.shape[0] % side
