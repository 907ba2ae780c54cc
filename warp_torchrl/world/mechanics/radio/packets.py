"""What a team's radio has under way: packets that were sent in the last steps, and those that arrive now."""

from dataclasses import dataclass
from typing import Self

import torch
from torch import Tensor

from warp_torchrl.world.arrays.batch import Batch, Named


@dataclass(eq=False, repr=False)
class Packets(Batch):
    """The packets of the last D = delay + 1 steps, the oldest first: [:, 0] arrives now, and [:, -1] is sent now.

    A packet waits in full, and not as what its receiver will know of it: what an agent knows is overwritten while it is
    under way.
    """

    links: Tensor  # bool [B,D,A,A], whether agent i (third) will have agent j's; False before the episode began
    places: Tensor  # int64 [B,D,A,2], (row, column) of the sender then [cells]
    maps: Tensor | None = None  # int32 [B,D,A,H,W], records that the sender knew then; None where no maps are told
    shown: Named | None = None  # [B,D,A,...] each, what the sender observed then; None where networks send nothing

    def sent(self, running: Tensor, **now: Tensor) -> Self:
        """Return the packets with what is sent now, by name, [B, A, ...] each, in the worlds that go on, bool [B]."""
        return self.replace(**{name: moved_up(getattr(self, name), each, running) for name, each in now.items()})

    def arriving(self, name: str) -> Tensor:
        """Return what arrives now, of the field of that name, [B, A, ...]."""
        steps: Tensor = getattr(self, name)
        return steps[:, 0]


def moved_up(steps: Tensor, now: Tensor, running: Tensor) -> Tensor:
    """Return steps [B, D, ...] without the first, and with ``now``, [B, ...], as the last.

    Args:
        steps: The oldest first.
        now: Of this step.
        running: Worlds that go on, bool [B]; the steps of the others stay as they are.
    """
    later = torch.cat((steps[:, 1:], now[:, None]), dim=1)
    return torch.where(running.view(-1, *[1] * now.ndim), later, steps)
