"""Wind fields: calm, uniform and the paper's.

A wind is a vector (u east, v north) in m/s that points where the air goes. Each component makes the field of an
episode, [B, 2, 1, 1] where it is the same over the map and [B, 2, H, W] where it is not.
"""

import math
from dataclasses import dataclass

import torch
from torch import Tensor

from warp_torchrl.world.random import Stream, uniform
from warp_torchrl.world.validation import check_fields


@dataclass(frozen=True, kw_only=True)
class Calm:
    """No wind."""

    def __call__(self, key: Tensor, size: tuple[int, int]) -> Tensor:
        """Return the field of each world, zeros, float32 [B, 2, 1, 1] [m/s]."""
        return torch.zeros(key.shape[0], 2, 1, 1, device=key.device)


@dataclass(frozen=True, kw_only=True)
class Uniform:
    """One wind over the whole map.

    Attributes:
        speed: Wind speed [m/s].
        direction: Where the air goes, degrees from east, counter-clockwise (90 is north); None draws a direction
            for each episode.

    Raises:
        ValueError: If the speed is not in [0, 60] or the direction not a finite angle.
    """

    speed: float = 4.0
    direction: float | None = None

    def __post_init__(self) -> None:
        check_fields(self, speed=(0.0, 60.0), direction=(-1e6, 1e6))

    def __call__(self, key: Tensor, size: tuple[int, int]) -> Tensor:
        """Return the field of each world, float32 [B, 2, 1, 1] [m/s]."""
        if self.direction is None:
            angle = uniform(key, 0, Stream.WIND, (1,)) * (2.0 * math.pi)
        else:
            angle = torch.full((key.shape[0], 1), math.radians(self.direction), device=key.device)
        return self.speed * torch.stack((angle.cos(), angle.sin()), dim=1)[..., None]


@dataclass(frozen=True, kw_only=True)
class Paper:
    """The paper's wind field on [-3, 3]^2, X east and Y north.

        U = -1 - X^2 + X + Y,   V = (1 + X^2 - Y^2) / 10      (WARP-CA, wind)

    The range is that of the plot that the formula comes from; with cell numbers in place of X and Y it would give
    speeds of thousands of m/s.

    Attributes:
        scale: Factor on both components.
        rotate: Draw a rotation of the whole field for each episode.

    Raises:
        ValueError: If the scale is not in [0, 10].
    """

    scale: float = 1.0
    rotate: bool = False

    def __post_init__(self) -> None:
        check_fields(self, scale=(0.0, 10.0))

    def __call__(self, key: Tensor, size: tuple[int, int]) -> Tensor:
        """Return the field of each world, float32 [B, 2, H, W] [m/s]."""
        north = torch.linspace(3.0, -3.0, size[0], device=key.device)[None, :, None]
        east = torch.linspace(-3.0, 3.0, size[1], device=key.device)[None, None, :]
        if self.rotate:
            angle = (uniform(key, 0, Stream.WIND, (1, 1)) * (2.0 * math.pi)).to(torch.float32)
            cosine, sine = angle.cos(), angle.sin()
        else:
            cosine, sine = torch.ones_like(key[:, None, None], dtype=torch.float32), 0.0
        x, y = cosine * east + sine * north, cosine * north - sine * east
        u, v = -1.0 - x * x + x + y, (1.0 + x * x - y * y) / 10.0
        return self.scale * torch.stack((cosine * u - sine * v, sine * u + cosine * v), dim=1)


Wind = Calm | Uniform | Paper
"""Any wind component."""


def constant_wind(u: float, v: float) -> Uniform:
    """Return the uniform wind with components u east and v north [m/s]."""
    return Uniform(speed=math.hypot(u, v), direction=math.degrees(math.atan2(v, u)))
