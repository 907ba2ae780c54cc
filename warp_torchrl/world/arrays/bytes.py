"""Comparisons, choices and look-ups on planes of bytes, at the speed of byte arithmetic.

On CPUs a comparison that writes bool, ``where`` and ``masked_fill`` are many times slower than arithmetic on bytes: a
comparison that writes its own type is vectorised, and a bool is a byte of 0 or 1. In a function that is fused,
comparisons and ``where`` cost nothing; there bools in memory and arithmetic on bytes are slow, and planes are read as
``to_int32`` numbers and written as bytes.
"""

import torch
from torch import Tensor

from warp_torchrl.world.arrays.compile import is_fused
from warp_torchrl.world.arrays.constants import numbers

_WORDS = 128
_ADDS_BYTES = ("cpu",)
"""Where compiled code adds bytes at places; on GPUs Inductor asks Triton for it, which does not."""


def to_int32(codes: Tensor) -> Tensor:
    """Return uint8 codes in the type to compute in: int32 in a function that is fused, and as they are elsewhere."""
    return codes.to(torch.int32) if is_fused() else codes


def to_uint8(codes: Tensor) -> Tensor:
    """Return codes that were made ``to_int32`` as uint8."""
    # Inductor has an instruction that makes int8 of sixteen numbers, and makes uint8 of them one by one.
    return codes if codes.dtype == torch.uint8 else codes.to(torch.int8).view(torch.uint8)


def at_least(codes: Tensor, bound: int) -> Tensor:
    """Return ``codes >= bound``, bool; codes are uint8."""
    if is_fused():
        return to_int32(codes) >= bound
    return torch.ge(codes, bound, out=torch.empty_like(codes)).view(torch.bool)


def between(codes: Tensor, low: int, high: int) -> Tensor:
    """Return which codes, uint8, are at least ``low`` and at most ``high``, bool."""
    if is_fused():
        return (to_int32(codes) >= low) & (to_int32(codes) <= high)
    above_low = codes - low  # a lower code wraps round to a high one
    return torch.le(above_low, high - low, out=above_low).view(torch.bool)


def equal(codes: Tensor, code: int) -> Tensor:
    """Return ``codes == code``, bool; codes are uint8."""
    if is_fused():
        return to_int32(codes) == code
    return torch.eq(codes, code, out=torch.empty_like(codes)).view(torch.bool)


def below(numbers: Tensor, bounds: Tensor | float) -> Tensor:
    """Return ``numbers < bounds``, bool; both are float32 of one shape, or the bound is one number."""
    if is_fused():
        return numbers < bounds
    return _as_flags(torch.lt(numbers, bounds, out=torch.empty_like(numbers)))


def above(numbers: Tensor, bound: float) -> Tensor:
    """Return ``numbers > bound``, bool; the numbers are float32."""
    if is_fused():
        return numbers > bound
    return _as_flags(torch.gt(numbers, bound, out=torch.empty_like(numbers)))


def _as_flags(numbers: Tensor) -> Tensor:
    """Return numbers 0 and 1, float32, as bool."""
    return numbers.to(torch.int32).to(torch.uint8).view(torch.bool)  # at once it takes twice the time


def byte(mask: Tensor) -> Tensor:
    """Return a bool mask as 0 and 1, uint8 and maybe in the mask's own memory, or ``to_int32`` ones."""
    return mask.to(torch.int32) if is_fused() else mask.view(torch.uint8)


def as_mask(codes: Tensor) -> Tensor:
    """Return codes 0 and 1 of ``byte`` as a bool mask, maybe in their own memory."""
    return codes != 0 if is_fused() else codes.view(torch.bool)


def view_as(plane: Tensor, codes: Tensor) -> Tensor:
    """Return codes 0 and 1 of ``byte`` in the type of a plane of flags, maybe in their own memory."""
    return to_uint8(codes) if is_fused() else codes.view(plane.dtype)


def number(mask: Tensor) -> Tensor:
    """Return a bool mask as 0 and 1, float32."""
    return mask.to(torch.float32) if is_fused() else mask.view(torch.uint8).to(torch.float32)


def choose(flags: Tensor, one: Tensor | int, other: Tensor) -> Tensor:
    """Return one, uint8 or ``to_int32``, where flags of ``byte`` are 1 and the other where they are 0."""
    if is_fused():
        return torch.where(as_mask(to_int32(flags)), to_int32(one) if isinstance(one, Tensor) else one, to_int32(other))
    return (one - other).mul_(flags).add_(other)


def zero_where(flags: Tensor, values: Tensor) -> Tensor:
    """Return values, uint8 or ``to_int32``, but 0 where flags of ``byte`` are 1."""
    if is_fused():
        return torch.where(as_mask(to_int32(flags)), 0, to_int32(values))
    return values * (flags ^ 1)


def counts(*codes: Tensor) -> tuple[Tensor, ...]:
    """Return how many cells of each map codes 0 and 1 of ``byte``, [B, H, W] each, mark, int32 [B] each."""
    if is_fused():
        return tuple(each.sum((-2, -1), dtype=torch.int32) for each in codes)
    maps = torch.stack(codes).flatten(-2)
    if maps.shape[-1] % 8:
        return maps.sum(-1, dtype=torch.int32).unbind()
    # Eight bytes are added at a time, as parts of a word; 128 ones at most, so that none runs into its neighbour.
    words = maps.view(torch.int64)
    whole = words.shape[-1] // _WORDS * _WORDS
    sums = words[..., :whole].unflatten(-1, (-1, _WORDS)).sum(-1), words[..., whole:].sum(-1, keepdim=True)
    return torch.cat(sums, dim=-1).view(torch.uint8).sum(-1, dtype=torch.int32).unbind()


def index_put(plane: Tensor, place: Tensor, values: Tensor | int) -> Tensor:
    """Return a plane [B, H, W] of any type that holds values, or one, at flat places int64 [N]; it is used up."""
    flat = plane.flatten()
    flat = flat.index_copy_(0, place, values) if isinstance(values, Tensor) else flat.index_fill_(0, place, values)
    return flat.view(plane.shape)


def scatter_add(codes: Tensor, index: Tensor, changes: Tensor) -> Tensor:
    """Return codes, uint8 [..., N], with changes, uint8 [..., K], added modulo 256 at places, int64 [..., K]."""
    if is_fused() and codes.device.type not in _ADDS_BYTES:
        return codes.to(torch.int32).scatter_add(-1, index, changes.to(torch.int32)).to(torch.uint8)
    return codes.scatter_add(-1, index, changes)


def look_up(table: tuple[float, ...], codes: Tensor) -> Tensor:
    """Return what a table holds for each code, float32, shape of the codes; they are uint8 and within it."""
    return numbers(table, codes.device).index_select(0, codes.flatten().to(torch.int32)).view(codes.shape)


def to_codes(numbers: Tensor) -> Tensor:
    """Return numbers in 0..255, cut to whole ones, uint8 or ``to_int32``."""
    codes = numbers.to(torch.int32)
    return codes if is_fused() else codes.to(torch.uint8)  # at once it takes twice the time
