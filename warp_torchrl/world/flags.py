"""Comparisons, choices and look-ups on planes of bytes, at the speed of byte arithmetic.

On CPUs a comparison that writes bool, ``where`` and ``masked_fill`` are many times slower than arithmetic on bytes: a
comparison that writes its own type is vectorised, and a bool is a byte of 0 or 1. A compiler that fuses these planes
wants them plain.
"""

from functools import lru_cache

import torch
from torch import Tensor
from torch.compiler import is_compiling

_WORDS = 128


def at_least(codes: Tensor, bound: int) -> Tensor:
    """Return ``codes >= bound``, bool; codes are uint8."""
    if is_compiling():
        return codes >= bound
    return torch.ge(codes, bound, out=torch.empty_like(codes)).view(torch.bool)


def at_most(codes: Tensor, bound: int) -> Tensor:
    """Return ``codes <= bound``, bool; codes are uint8."""
    if is_compiling():
        return codes <= bound
    return torch.le(codes, bound, out=torch.empty_like(codes)).view(torch.bool)


def equal(codes: Tensor, code: int) -> Tensor:
    """Return ``codes == code``, bool; codes are uint8."""
    if is_compiling():
        return codes == code
    return torch.eq(codes, code, out=torch.empty_like(codes)).view(torch.bool)


def below(numbers: Tensor, bounds: Tensor | float) -> Tensor:
    """Return ``numbers < bounds``, bool; both are float32 of one shape, or the bound is one number."""
    if is_compiling():
        return numbers < bounds
    return _as_flags(torch.lt(numbers, bounds, out=torch.empty_like(numbers)))


def above(numbers: Tensor, bound: float) -> Tensor:
    """Return ``numbers > bound``, bool; the numbers are float32."""
    if is_compiling():
        return numbers > bound
    return _as_flags(torch.gt(numbers, bound, out=torch.empty_like(numbers)))


def _as_flags(numbers: Tensor) -> Tensor:
    """Return numbers 0 and 1, float32, as bool."""
    return numbers.to(torch.int32).to(torch.uint8).view(torch.bool)  # at once it takes twice the time


def byte(mask: Tensor) -> Tensor:
    """Return a bool mask as 0 and 1, uint8, maybe in the mask's own memory."""
    return mask.to(torch.uint8) if is_compiling() else mask.view(torch.uint8)


def as_mask(codes: Tensor) -> Tensor:
    """Return codes 0 and 1, uint8, as a bool mask, maybe in their own memory."""
    return codes.to(torch.bool) if is_compiling() else codes.view(torch.bool)


def number(mask: Tensor) -> Tensor:
    """Return a bool mask as 0 and 1, float32."""
    return byte(mask).to(torch.float32)


def choose(mask: Tensor, one: Tensor | int, other: Tensor) -> Tensor:
    """Return ``where(mask, one, other)``, uint8, for a bool mask of the shape of ``other``."""
    if is_compiling():
        return torch.where(mask, one, other)
    return (one - other).mul_(mask.view(torch.uint8)).add_(other)


def clear(mask: Tensor, values: Tensor) -> Tensor:
    """Return ``values`` with 0 where the bool mask is set, uint8; the mask has their shape."""
    if is_compiling():
        return torch.where(mask, 0, values)
    return values * (~mask).view(torch.uint8)


def count(mask: Tensor) -> Tensor:
    """Return how many cells of each map bool masks [..., H, W] mark, int32 [...]."""
    if is_compiling():
        return mask.sum((-2, -1), dtype=torch.int32)
    codes = mask.view(torch.uint8).flatten(-2)
    if codes.shape[-1] % 8:
        return codes.sum(-1, dtype=torch.int32)
    # Eight bytes are added at a time, as parts of a word; 128 ones at most, so that none runs into its neighbour.
    words = codes.view(torch.int64)
    whole = words.shape[-1] // _WORDS * _WORDS
    sums = words[..., :whole].unflatten(-1, (-1, _WORDS)).sum(-1), words[..., whole:].sum(-1, keepdim=True)
    return torch.cat(sums, dim=-1).view(torch.uint8).sum(-1, dtype=torch.int32)


def put(plane: Tensor, place: Tensor, values: Tensor | int) -> Tensor:
    """Return a plane [B, H, W] that holds values, or one, at flat places int64 [N]; the plane is used up."""
    flat = plane.flatten()
    flat = flat.index_copy_(0, place, values) if isinstance(values, Tensor) else flat.index_fill_(0, place, values)
    return flat.view(plane.shape)


def look_up(table: tuple[float, ...], codes: Tensor) -> Tensor:
    """Return what a table holds for each code, float32, shape of the codes; they are uint8 and within it."""
    return numbers(table, codes.device).index_select(0, codes.flatten().to(torch.int32)).view(codes.shape)


@lru_cache(maxsize=64)
def numbers(values: tuple[float, ...], device: torch.device) -> Tensor:
    """Return some numbers as a tensor, float32 [n], kept for the next time."""
    return torch.tensor(values, dtype=torch.float32, device=device)
