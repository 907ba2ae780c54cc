"""Orders: sectors to which people send vehicles."""

from dataclasses import dataclass

import torch
from torch import Tensor

from warp_torchrl.validation import check_fields
from warp_torchrl.world.arrays.geometry import DIRECTIONS
from warp_torchrl.world.state.state import Action


@dataclass(frozen=True, kw_only=True)
class Order:
    """A sector: the cells within a Chebyshev distance of a place.

    An order is a mask, not an observation: the policy sees what it always sees, and chooses among fewer actions. So an
    order needs no policy that was trained with orders. On the way to the sector the moves that lead nearer are open,
    and extinguish where it does something. Within the sector the moves that lead out of it are closed, and all else is
    as ever. Where nothing would be left, as behind a lake, the order closes nothing for that step.

    Attributes:
        row: Of the place [cells].
        column: Of the place [cells].
        radius: Of the sector [cells]; 0 is the place alone.

    Raises:
        ValueError: If a value is out of its range.
    """

    row: int
    column: int
    radius: int = 3

    def __post_init__(self) -> None:
        check_fields(self, row=(0, 1_000_000), column=(0, 1_000_000), radius=(0, 1_000_000))

    def distance(self, position: Tensor) -> Tensor:
        """Return the Chebyshev distance of cells (row, column), int64 [..., 2], from the place, int64 [...] [cells]."""
        return (position - torch.tensor([self.row, self.column])).abs().amax(dim=-1)

    def mask(self, open_actions: Tensor, position: Tensor, stride: int) -> Tensor:
        """Return which of one vehicle's open actions the order leaves open.

        Args:
            open_actions: bool [actions].
            position: (row, column), int64 [2] [cells].
            stride: Cells that a move goes.

        Returns:
            bool [actions].
        """
        here, there = self.distance(position), self.distance(position + torch.tensor(DIRECTIONS) * stride)
        left = open_actions.clone()
        if here <= self.radius:
            left[: len(DIRECTIONS)] &= there <= self.radius
        else:
            left[:] = False
            left[: len(DIRECTIONS)] = open_actions[: len(DIRECTIONS)] & (there < here)
            left[Action.EXTINGUISH] = open_actions[Action.EXTINGUISH]
        return left if left.any() else open_actions

    def nearest_move(self, left: Tensor, position: Tensor, stride: int) -> int | None:
        """Return the open move that ends nearest to the place; None if no move is open.

        Args:
            left: Open actions, bool [actions].
            position: (row, column), int64 [2] [cells].
            stride: Length of a move [cells].
        """
        gap = (position + torch.tensor(DIRECTIONS) * stride - torch.tensor([self.row, self.column])).abs().float()
        way = (gap.amax(dim=-1) + 0.01 * gap.sum(dim=-1)).masked_fill(~left[: len(DIRECTIONS)], torch.inf)
        return int(way.argmin()) if left[: len(DIRECTIONS)].any() else None
