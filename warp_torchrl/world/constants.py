"""Tensors that never change: each is made once for a device, and read from then on.

A function that is fused reads them too. Else it would make the numbers of each vector one by one, which on CPUs takes
as long as to mix them for a draw.
"""

from functools import lru_cache

import torch
from torch import Tensor


@torch.compiler.assume_constant_result
def numbers(values: tuple[float, ...], device: torch.device) -> Tensor:
    """Return some numbers as a tensor, float32 [n]."""
    return _numbers(values, device)


@torch.compiler.assume_constant_result
def counting(length: int, device: torch.device) -> Tensor:
    """Return 0, 1, ... below a length, int32 [length]."""
    return _counting(length, device)


# A compiler looks through ``lru_cache``, and would not take what a function so wrapped returns for a constant.
@lru_cache(maxsize=64)
def _numbers(values: tuple[float, ...], device: torch.device) -> Tensor:
    return torch.tensor(values, dtype=torch.float32, device=device)


@lru_cache(maxsize=64)
def _counting(length: int, device: torch.device) -> Tensor:
    return torch.arange(length, dtype=torch.int32, device=device)
