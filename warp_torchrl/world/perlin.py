"""Batched fractal gradient noise after Perlin (2002), for the terrain of WARP-CA."""

import math

import torch
from torch import Tensor

from warp_torchrl.world.random import Stream, uniform


def fade(t: Tensor) -> Tensor:
    """Return the quintic fade f(t) = 6 t^5 - 15 t^4 + 10 t^3 (WARP-CA, terrain; Perlin 2002)."""
    return t * t * t * (t * (t * 6.0 - 15.0) + 10.0)


def fractal_noise(
    key: Tensor, size: tuple[int, int], frequencies: list[float], amplitudes: list[float], stream: Stream
) -> Tensor:
    """Return a weighted sum of gradient-noise octaves, each with its own random offset.

        n(x, y) = sum_i a_i noise_i(x f_i + o_i, y f_i + o'_i)      (WARP-CA, terrain)

    Without an offset every octave of integer scale would vanish at the same lattice points.

    Args:
        key: World keys, int64 [B].
        size: (H, W) [cells].
        frequencies: f_i of each octave [1 / cell].
        amplitudes: a_i of each octave.
        stream: The stream that its gradients are drawn from.

    Returns:
        float32 [B, H, W], about zero, not normalised.
    """
    worlds = key.shape[0]
    total = torch.zeros(worlds, *size, device=key.device)
    offsets = uniform(key, 0, stream, (len(frequencies), 2))
    for octave, (frequency, amplitude) in enumerate(zip(frequencies, amplitudes, strict=True)):
        lattice = tuple(math.ceil((length - 1) * frequency) + 3 for length in size)
        angle = uniform(key, octave + 1, stream, lattice).mul_(2.0 * math.pi)
        gradients = torch.stack((angle.sin(), angle.cos()), dim=-1)
        total += amplitude * _octave(gradients, offsets[:, octave], frequency, size)
    return total


def _octave(gradients: Tensor, offset: Tensor, frequency: float, size: tuple[int, int]) -> Tensor:
    """Interpolate one octave from its lattice of gradients, float32 [B, P, Q, 2] -> [B, H, W]."""
    rows, row_part = _locate(size[0], frequency, offset[:, 0])
    columns, column_part = _locate(size[1], frequency, offset[:, 1])
    row_part, column_part = row_part[:, :, None], column_part[:, None, :]
    row_fade, column_fade = fade(row_part), fade(column_part)
    width = gradients.shape[2]
    flat = gradients.flatten(1, 2)

    def corner(down: int, right: int) -> Tensor:
        index = ((rows + down)[:, :, None] * width + (columns + right)[:, None, :]).flatten(1)
        gradient = flat.gather(1, index[..., None].expand(-1, -1, 2)).view(-1, *size, 2)
        return gradient[..., 0] * (row_part - down) + gradient[..., 1] * (column_part - right)

    top = corner(0, 0) + column_fade * (corner(0, 1) - corner(0, 0))
    bottom = corner(1, 0) + column_fade * (corner(1, 1) - corner(1, 0))
    return top + row_fade * (bottom - top)


def _locate(length: int, frequency: float, offset: Tensor) -> tuple[Tensor, Tensor]:
    """Return each cell's lattice index, int64 [B, length], and its place between lattice points in [0, 1)."""
    place = torch.arange(length, device=offset.device) * frequency + offset[:, None]
    lattice = place.floor()
    return lattice.to(torch.int64), place - lattice
