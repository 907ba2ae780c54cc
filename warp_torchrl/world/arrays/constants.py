"""Tensors of plain numbers."""

import torch
from torch import Tensor

from warp_torchrl.system.modes import kept


@kept(64)
def numbers(values: tuple[float, ...], device: torch.device) -> Tensor:
    """Return some numbers as a tensor, float32 [n], kept for the next time."""
    return torch.tensor(values, dtype=torch.float32, device=device)


@kept(64)
def whole_numbers(values: tuple[int, ...], device: torch.device) -> Tensor:
    """Return some whole numbers as a tensor, int64 [n], kept for the next time."""
    return torch.tensor(values, dtype=torch.int64, device=device)
