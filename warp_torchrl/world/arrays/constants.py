"""Tensors of plain numbers."""

import torch
from torch import Tensor

from warp_torchrl.system.modes import kept
from warp_torchrl.world.arrays.compile import opaque_op


@kept(64)
def numbers(values: tuple[float, ...], device: torch.device) -> Tensor:
    """Return some numbers as a tensor, float32 [n], kept for the next time."""
    return torch.tensor(values, dtype=torch.float32, device=device)


@kept(64)
def whole_numbers(values: tuple[int, ...], device: torch.device) -> Tensor:
    """Return some whole numbers as a tensor, int64 [n], kept for the next time."""
    return torch.tensor(values, dtype=torch.int64, device=device)


# A compiler would make the numbers of each vector one by one, which on CPUs takes as long as to mix them for a draw.
@opaque_op("(int length, Tensor beside) -> Tensor")
def counting(length: int, beside: Tensor) -> Tensor:
    """Return 0, 1, ... below a length, int32 [length], where another tensor lives, one that is in memory anyway."""
    return torch.arange(length, dtype=torch.int32, device=beside.device)
