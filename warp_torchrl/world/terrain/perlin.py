"""Batched fractal gradient noise after Perlin (2002), for the terrain of WARP-CA."""

import math
from collections.abc import Sequence

import torch
from torch import Tensor

from warp_torchrl.world.arrays.random import Stream, uniform


def fade(t: Tensor) -> Tensor:
    """Return the quintic fade f(t) = 6 t^5 - 15 t^4 + 10 t^3 (WARP-CA, terrain; Perlin 2002)."""
    return t * t * t * (t * (t * 6.0 - 15.0) + 10.0)


def fractal_noise(
    key: Tensor,
    size: tuple[int, int],
    frequencies: list[float] | Tensor,
    amplitudes: list[float] | Tensor,
    stream: Stream,
    finest: list[float] | None = None,
) -> Tensor:
    """Return a weighted sum of gradient-noise octaves, each with another random offset.

        n(x, y) = sum_i a_i noise_i(x f_i + o_i, y f_i + o'_i)      (WARP-CA, terrain)

    Without an offset every octave of integer scale would vanish at the same lattice points.

    Args:
        key: World keys, int64 [B].
        size: (H, W) [cells].
        frequencies: f_i of each octave, for all worlds, or float32 [B, O] [1 / cell].
        amplitudes: a_i of each octave, for all worlds, or float32 [B, O].
        stream: The stream of its gradients' draws.
        finest: The highest f_i of each octave in any world of any batch, where worlds differ [1 / cell].

    Returns:
        float32 [B, H, W], about zero, not normalised.
    """
    device, worlds = key.device, len(key)
    bounds: Sequence[float] | Tensor = frequencies if finest is None else finest
    frequency, amplitude = (
        torch.as_tensor(each, dtype=torch.float32, device=device).expand(worlds, -1)
        for each in (frequencies, amplitudes)
    )
    lattices = [tuple(math.ceil((length - 1) * f) + 3 for length in size) for f in bounds]
    offsets = uniform(key, 0, stream, (len(lattices), 2))
    rows, row_parts = _locate(size[0], frequency[..., None], offsets[..., 0])
    columns, column_parts = _locate(size[1], frequency[..., None], offsets[..., 1])
    points = sum(height * width for height, width in lattices)
    angle = uniform(key, 1, stream, (points,)).mul_(2.0 * math.pi)
    gradients = angle.sin().flatten(), angle.cos_().flatten()
    # Of an octave's gradients in each world; a look-up is faster with indices of half the bytes.
    first = torch.arange(worlds, device=key.device)[:, None] * points
    number = torch.int32 if worlds * points < 2**31 else torch.int64
    total = torch.zeros(worlds, *size, device=key.device)
    planes = [torch.empty_like(total) for _ in range(4)]
    for octave, (height, width) in enumerate(lattices):  # one after the other: a sum's order is always the same
        row = (first + rows[:, octave] * width).to(number)
        index = row[:, :, None] + columns[:, octave, None, :].to(number)
        parts = row_parts[:, octave, :, None], column_parts[:, octave, None, :]
        total += _octave(gradients, index.flatten(), width, *parts, planes).mul_(amplitude[:, octave, None, None])
        first += height * width
    return total


def _octave(
    gradients: tuple[Tensor, Tensor],
    index: Tensor,
    width: int,
    row_part: Tensor,
    column_part: Tensor,
    planes: list[Tensor],
) -> Tensor:
    """Return gradient noise of one octave, float32 [B, H, W], in the memory of one of the planes.

    Args:
        gradients: Their parts along the rows' axis and along the columns', float32 [n] each.
        index: Where the gradient at each cell's north-west lattice point stands among them, int32 or int64 [B H W].
        width: Columns of the lattice.
        row_part: Place of each row between lattice points in [0, 1), float32 [B, H, 1].
        column_part: Likewise, float32 [B, 1, W].
        planes: Four that are used up, float32 [B, H, W]: few that stay in the cache are faster than fresh ones.
    """
    one, top, bottom, spare = planes
    to_rows, to_columns = (row_part, row_part - 1), (column_part, column_part - 1)

    def corner(down: int, right: int, made: Tensor) -> Tensor:
        for gradient, plane in zip(gradients, (made, spare)):
            torch.index_select(gradient[down * width + right :], 0, index, out=plane.view(-1))
        return made.mul_(to_rows[down]).add_(spare.mul_(to_columns[right]))

    across = fade(column_part)
    _blend(corner(0, 0, one), corner(0, 1, top), across)
    _blend(corner(1, 0, one), corner(1, 1, bottom), across)
    return _blend(top, bottom, fade(row_part))


def _blend(one: Tensor, other: Tensor, share: Tensor) -> Tensor:
    """Return one + share (other - one), in the other's memory."""
    return other.sub_(one).mul_(share).add_(one)


def _locate(length: int, frequency: Tensor, offset: Tensor) -> tuple[Tensor, Tensor]:
    """Return each cell's lattice index, int64 [B, O, length], and its place between lattice points in [0, 1)."""
    place = torch.arange(length, device=offset.device) * frequency + offset[..., None]
    lattice = place.floor()
    return lattice.to(torch.int64), place - lattice
