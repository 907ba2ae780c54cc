"""Whole numbers in order."""

import torch
from torch import Tensor

from warp_torchrl.world.arrays.compile import opaque_op


# A compiler would make the numbers of each vector one by one, which on CPUs takes as long as to mix them for a draw.
@opaque_op("(int length, Tensor beside) -> Tensor")
def counting(length: int, beside: Tensor) -> Tensor:
    """Return 0, 1, ... below a length, int32 [length], where another tensor lives, one that is in memory anyway."""
    return torch.arange(length, dtype=torch.int32, device=beside.device)
