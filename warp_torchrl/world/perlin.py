"""Batched fractal gradient noise after Perlin (2002), for the terrain of WARP-CA."""

import math
from collections.abc import Sequence
from itertools import accumulate

import torch
from torch import Tensor

from warp_torchrl.world.random import Stream, uniform


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
    """Return a weighted sum of gradient-noise octaves, each with its own random offset.

        n(x, y) = sum_i a_i noise_i(x f_i + o_i, y f_i + o'_i)      (WARP-CA, terrain)

    Without an offset every octave of integer scale would vanish at the same lattice points.

    Args:
        key: World keys, int64 [B].
        size: (H, W) [cells].
        frequencies: f_i of each octave, for all worlds, or float32 [B, O] [1 / cell].
        amplitudes: a_i of each octave, for all worlds, or float32 [B, O].
        stream: The stream that its gradients are drawn from.
        finest: The highest f_i of each octave in any world of any batch, where worlds differ [1 / cell].

    Returns:
        float32 [B, H, W], about zero, not normalised.
    """
    device = key.device
    bounds: Sequence[float] | Tensor = frequencies if finest is None else finest
    frequency, amplitude = (
        torch.as_tensor(each, dtype=torch.float32, device=device) for each in (frequencies, amplitudes)
    )
    frequency = frequency[..., None]
    offsets = uniform(key, 0, stream, (len(bounds), 2))
    rows, row_part = _locate(size[0], frequency, offsets[..., 0])
    columns, column_part = _locate(size[1], frequency, offsets[..., 1])
    lattices = [tuple(math.ceil((length - 1) * f) + 3 for length in size) for f in bounds]
    widths = torch.tensor([width for _, width in lattices], device=device)[:, None, None]
    starts = [0, *accumulate(height * width for height, width in lattices)]
    angle = uniform(key, 1, stream, (starts[-1],)).mul_(2.0 * math.pi)
    gradients = torch.stack((angle.sin(), angle.cos()))
    first = (
        torch.tensor(starts[:-1], device=device)[:, None, None] + rows[..., :, None] * widths + columns[..., None, :]
    )
    row_part, column_part = row_part[..., :, None], column_part[..., None, :]
    row_fade, column_fade = fade(row_part), fade(column_part)

    def corner(down: int, right: int) -> Tensor:
        index = (first + (down * widths + right)).flatten(1)
        along_row, along_column = gradients.gather(2, index.expand(2, -1, -1)).view(2, *first.shape)
        return along_row * (row_part - down) + along_column * (column_part - right)

    top_left, bottom_left = corner(0, 0), corner(1, 0)
    top = top_left + column_fade * (corner(0, 1) - top_left)
    bottom = bottom_left + column_fade * (corner(1, 1) - bottom_left)
    octaves = top + row_fade * (bottom - top)
    total = torch.zeros(key.shape[0], *size, device=device)
    for octave in range(len(bounds)):  # one after the other: a sum's order must not depend on the batch
        total += amplitude[..., octave, None, None] * octaves[:, octave]
    return total


def _locate(length: int, frequency: Tensor, offset: Tensor) -> tuple[Tensor, Tensor]:
    """Return each cell's lattice index, int64 [B, O, length], and its place between lattice points in [0, 1)."""
    place = torch.arange(length, device=offset.device) * frequency + offset[..., None]
    lattice = place.floor()
    return lattice.to(torch.int64), place - lattice
