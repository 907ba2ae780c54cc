"""Wind fields: calm, uniform, the paper's, and a wandering one.

A wind is a vector (u east, v north) in m/s that points where the air goes. Each component makes the field at the start
of an episode, [B, 2, 1, 1] where it is the same over the map and [B, 2, H, W] where it is not, and then the next.
"""

import math
from abc import ABC, abstractmethod
from collections.abc import Iterator
from dataclasses import dataclass

import torch
from torch import Tensor

from warp_torchrl.validation import check_fields
from warp_torchrl.world.arrays.random import Stream, uniform
from warp_torchrl.world.state.state import Landscape, WorldState
from warp_torchrl.world.terrain.source import LandscapeSource

_FASTEST = 60.0  # m/s


class Wind(ABC):
    """Interface of a wind component."""

    @property
    def changes(self) -> bool:
        """Return whether the wind of a tick may differ from that of the tick before."""
        return False

    @property
    def wanders(self) -> bool:
        """Return whether the wind of every tick differs from that of the tick before."""
        return False

    @abstractmethod
    def __call__(self, key: Tensor, size: tuple[int, int], corner: Tensor | None = None) -> Tensor:
        """Return the field of each world at the start, float32 [B, 2, 1, 1] or [B, 2, H, W] [m/s].

        Args:
            key: World keys, int64 [B].
            size: (H, W) [cells].
            corner: (row, column) of each world's first cell in the landscape's source, int64 [B, 2]; None: (0, 0).
        """

    def shaped(self, ground: Landscape, cell_size: float) -> Landscape:
        """Return landscapes with layers of what it makes of their ground, for ``on`` and ``after_tick``."""
        return ground

    def on(self, key: Tensor, ground: Landscape) -> Tensor:
        """Return the field of each world at the start on its landscape, which it has ``shaped``; see ``__call__``."""
        return self(key, (ground.cover.shape[1], ground.cover.shape[2]), ground.corner)

    def after_tick(self, state: WorldState) -> Tensor:
        """Return the field of each world after its tick number ``state.tick``, shape of ``state.wind`` [m/s]."""
        return state.wind

    def moisture(self, key: Tensor, tick: Tensor) -> Tensor | None:
        """Return the moisture of dead and live fuel after tick number ``tick``, int [B], or None without one.

        Returns:
            float32 [B, 7] [%]: dead fuel of 1, 10 and 100 hours, live herbaceous and woody; the codes FFMC and BUI.
        """
        return None

    def hours(self, key: Tensor, ground: Landscape) -> Iterator[tuple[Tensor, Tensor | None]]:
        """Return the fields that it is known to have, each with its moisture: here that of the start."""
        yield self.on(key, ground), self.moisture(key, torch.zeros_like(key))

    def paced(self, minutes: float | None) -> "Wind":
        """Return the wind for ticks of ``minutes``; None where ticks have no minutes.

        Raises:
            ValueError: If it needs minutes and there are none.
        """
        return self

    def over(self, landscape: LandscapeSource) -> "Wind":
        """Return the wind on a landscape's map.

        Raises:
            ValueError: If it does not fit there.
        """
        return self


@dataclass(frozen=True, kw_only=True)
class Calm(Wind):
    """No wind."""

    def __call__(self, key: Tensor, size: tuple[int, int], corner: Tensor | None = None) -> Tensor:
        """Return the field of each world, zeros, float32 [B, 2, 1, 1] [m/s]."""
        return torch.zeros(key.shape[0], 2, 1, 1, device=key.device)


@dataclass(frozen=True, kw_only=True)
class Uniform(Wind):
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
        check_fields(self, speed=(0.0, _FASTEST), direction=(-1e6, 1e6))

    def __call__(self, key: Tensor, size: tuple[int, int], corner: Tensor | None = None) -> Tensor:
        """Return the field of each world, float32 [B, 2, 1, 1] [m/s]."""
        return _vector(torch.full_like(key, self.speed, dtype=torch.float32), _angle(key, self.direction))


@dataclass(frozen=True, kw_only=True)
class Paper(Wind):
    """The paper's wind field on [-3, 3]^2, X east and Y north.

        U = -1 - X^2 + X + Y,   V = (1 + X^2 - Y^2) / 10      (WARP-CA, wind)

    The range is that of the formula's plot; with cell numbers for X and Y it would give speeds of thousands of m/s.

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

    def __call__(self, key: Tensor, size: tuple[int, int], corner: Tensor | None = None) -> Tensor:
        """Return the field of each world, float32 [B, 2, H, W] [m/s]."""
        north = torch.linspace(3.0, -3.0, size[0], device=key.device)[None, :, None]
        east = torch.linspace(-3.0, 3.0, size[1], device=key.device)[None, None, :]
        cosine = torch.ones_like(key[:, None, None], dtype=torch.float32)
        sine: Tensor | float = 0.0
        if self.rotate:
            angle = (uniform(key, 0, Stream.WIND, (1, 1)) * (2.0 * math.pi)).to(torch.float32)
            cosine, sine = _cosine_and_sine(angle)
        x, y = cosine * east + sine * north, cosine * north - sine * east
        u, v = -1.0 - x * x + x + y, (1.0 + x * x - y * y) / 10.0
        return self.scale * torch.stack((cosine * u - sine * v, sine * u + cosine * v), dim=1)


@dataclass(frozen=True, kw_only=True)
class Wandering(Wind):
    """One wind over the whole map that changes with every tick, about a mean speed and direction.

        x(t + 1) = mean + (x(t) - mean) a + deviation sqrt(1 - a^2) n,   a = exp(-1 / memory)

    for speed and direction alike: Ornstein-Uhlenbeck processes, sampled exactly and stationary from the first tick on
    (Uhlenbeck and Ornstein 1930), n standard normal. A speed below 0 is reflected.

    Attributes:
        speed: Mean speed [m/s], before reflection.
        direction: Mean of where the air goes, degrees from east, counter-clockwise; None draws it for each episode,
            with the draw of ``Uniform``.
        speed_deviation: Standard deviation of the speed [m/s].
        direction_deviation: Standard deviation of the direction [degrees].
        memory: Ticks in which a departure from the mean falls to 1 / e.

    Raises:
        ValueError: If a value is out of its range.
    """

    speed: float = 4.0
    direction: float | None = None
    speed_deviation: float = 1.0
    direction_deviation: float = 30.0
    memory: float = 20.0

    def __post_init__(self) -> None:
        check_fields(
            self,
            speed=(0.0, _FASTEST),
            direction=(-1e6, 1e6),
            speed_deviation=(0.0, 20.0),
            direction_deviation=(0.0, 90.0),
            memory=(0.1, 1e6),
        )

    @property
    def changes(self) -> bool:
        """Return True."""
        return True

    @property
    def wanders(self) -> bool:
        """Return True."""
        return True

    def __call__(self, key: Tensor, size: tuple[int, int], corner: Tensor | None = None) -> Tensor:
        """Return the wind of each world at the start, float32 [B, 2, 1, 1] [m/s]."""
        gust = _normals(key, torch.zeros_like(key))
        speed = self.speed + self.speed_deviation * gust[:, 0]
        turn = math.radians(self.direction_deviation) * gust[:, 1]
        return _vector(self._reflected(speed), _angle(key, self.direction) + turn)

    def after_tick(self, state: WorldState) -> Tensor:
        """Return the wind of each world after its tick number ``state.tick``, float32 [B, 2, 1, 1] [m/s]."""
        kept = math.exp(-1.0 / self.memory)
        fresh = math.sqrt(-math.expm1(-2.0 / self.memory))
        gust = fresh * _normals(state.key, state.tick)
        u, v = state.wind[:, 0, 0, 0], state.wind[:, 1, 0, 0]
        mean = _angle(state.episode_key, self.direction)
        turn = _angle_between(*_cosine_and_sine(mean), u, v)
        speed = self.speed + (torch.hypot(u, v) - self.speed) * kept + self.speed_deviation * gust[:, 0]
        turn = turn * kept + math.radians(self.direction_deviation) * gust[:, 1]
        return _vector(self._reflected(speed), mean + turn)

    def _reflected(self, speed: Tensor) -> Tensor:
        return speed.abs().clamp(1e-3, _FASTEST)  # at 0 the direction would be forgotten


def constant_wind(u: float, v: float) -> Uniform:
    """Return the uniform wind with components u east and v north [m/s]."""
    return Uniform(speed=math.hypot(u, v), direction=math.degrees(math.atan2(v, u)))


def _angle(key: Tensor, direction: float | None) -> Tensor:
    """Return a direction in degrees, or one drawn for each world's episode, as an angle, float32 [B] [radians]."""
    if direction is None:
        return uniform(key, 0, Stream.WIND, (1,))[:, 0] * (2.0 * math.pi)
    return torch.full_like(key, math.radians(direction), dtype=torch.float32)


def _vector(speed: Tensor, angle: Tensor) -> Tensor:
    """Return the wind of a speed [B] [m/s] and an angle [B] [radians], float32 [B, 2, 1, 1] [m/s]."""
    return (speed * torch.stack(_cosine_and_sine(angle))).T[:, :, None, None]


def _cosine_and_sine(angle: Tensor) -> tuple[Tensor, Tensor]:
    """Return both, float32 of float32, the nearest to their values: a GPU's own float32 ones have other last bits."""
    exact = angle.to(torch.float64)
    return exact.cos().to(torch.float32), exact.sin().to(torch.float32)


def _angle_between(east: Tensor, north: Tensor, u: Tensor, v: Tensor) -> Tensor:
    """Return the angle from a unit vector to another vector, in (-pi, pi], float32 [B] [radians].

    By the half angle's tangent: torch's ``atan2`` gives other last bits in other batches, and a world must not.
    """
    along, across = u * east + v * north, v * east - u * north
    return 2.0 * torch.atan(across / (torch.hypot(along, across) + along).clamp(min=1e-12))


def _normals(key: Tensor, tick: Tensor) -> Tensor:
    """Draw two standard normals for each world, float32 [B, 2] (Box and Muller 1958)."""
    first, second = uniform(key, tick, Stream.GUST, (2,)).unbind(dim=1)
    radius, angle = (-2.0 * torch.log1p(-first)).sqrt(), second * (2.0 * math.pi)
    return torch.stack(_cosine_and_sine(angle), dim=1) * radius[:, None]


def turned(wind: Tensor, angle: Tensor) -> Tensor:
    """Return winds (u east, v north) that are turned to the left.

    Args:
        wind: float32 [n or 1, 2, ...].
        angle: [rad], float32 [n].
    """
    east, north = wind.unbind(1)
    angle = angle.view(-1, *[1] * (east.ndim - 1))
    return torch.stack((east * angle.cos() - north * angle.sin(), east * angle.sin() + north * angle.cos()), dim=1)
