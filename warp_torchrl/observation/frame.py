"""Frames: how each agent holds the map, so that what it learns of a fire on one side it knows of all.

The fire's law is the same on a map that is turned or mirrored (with its wind), and so is what a team should do. An
agent in a frame of its own sees the map turned and mirrored so that the fire lies between its east and its south-east,
and steers in the same terms; the environment translates.
"""

from dataclasses import dataclass
from functools import lru_cache

import torch
from torch import Tensor

from warp_torchrl.world.geometry import DIRECTIONS
from warp_torchrl.world.state import Action

NEAR = 2.0
"""Distance that is added to that of a fire, so that those at hand count alike [cells]."""


@dataclass(frozen=True, eq=False)
class Frame:
    """The frames of the agents of a batch of worlds.

    Attributes:
        sign: -1 where rows, columns are mirrored, else 1, int64 [B, A, 2].
        swapped: Whether rows and columns change places after that, bool [B, A].
    """

    sign: Tensor
    swapped: Tensor

    def turned(self, vector: Tensor) -> Tensor:
        """Return vectors (rows, columns) of the map as each agent holds them, [B, A, 2]."""
        signed = vector * self.sign
        return torch.where(self.swapped[..., None], signed.flip(-1), signed)

    def steered(self, action: Tensor) -> Tensor:
        """Return actions on the map, int64 [B, A], as each agent would say them."""
        return _table(False, action.device)[self._index(), action]

    def on_map(self, action: Tensor) -> Tensor:
        """Return what the actions that agents say, int64 [B, A], are on the map."""
        return _table(True, action.device)[self._index(), action]

    def reordered(self, entries: Tensor) -> Tensor:
        """Return an entry for each action on the map, [B, A, 10 or 11], in the order in which each agent says them."""
        return entries.gather(-1, _table(True, entries.device)[self._index(), : entries.shape[-1]])

    def reordered_back(self, entries: Tensor) -> Tensor:
        """Undo ``reordered``."""
        return entries.gather(-1, _table(False, entries.device)[self._index(), : entries.shape[-1]])

    def _index(self) -> Tensor:
        mirrored = (self.sign < 0).to(torch.int64)
        return mirrored[..., 0] * 4 + mirrored[..., 1] * 2 + self.swapped


def facing(fire: Tensor, away: Tensor) -> Frame:
    """Return the frames in which the fire lies between the agent's east and its south-east.

    Where it lies is told by the sum of the offsets to what burns, each over (its king's moves + ``NEAR``)^3.

    Args:
        fire: What burns, float32 [B, 1 or A, N].
        away: Offset (rows, columns) of each [cells], float32 [B, A, N, 2].
    """
    weight = fire / (away.abs().amax(-1) + NEAR) ** 3
    pull = (weight[..., None] * away).sum(-2)
    side = pull.abs()
    return Frame(sign=1 - 2 * (pull < 0.0).to(torch.int64), swapped=side[..., 0] > side[..., 1])


@lru_cache(maxsize=8)
def _table(on_map: bool, device: torch.device) -> Tensor:
    """Return each action in each frame, on the map or as the agent says it, int64 [8, 11]."""
    corner = torch.tensor([-1, 1])
    sign = torch.cartesian_prod(-corner, -corner).repeat_interleave(2, dim=0)
    swapped = torch.tensor([False, True]).repeat(4)
    offsets = torch.tensor(DIRECTIONS).expand(8, -1, -1)
    seen = Frame(sign=sign[:, None], swapped=swapped[:, None]).turned(offsets)
    moves = (seen[:, :, None] == offsets[:, None]).all(-1).to(torch.int64).argmax(-1)
    moves = moves.argsort(-1) if on_map else moves
    others = torch.arange(len(DIRECTIONS), len(Action)).expand(8, -1)
    return torch.cat((moves, others), dim=-1).to(device)
