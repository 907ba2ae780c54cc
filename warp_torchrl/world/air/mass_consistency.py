"""Mass-consistent wind over hills: the least change of a first guess that neither makes air nor blows through ground.

The wind (u, v, w) is the minimum of

    sum over the air of  (u - u0)^2 + (v - v0)^2 + (w - w0)^2 / alpha^2,   with div (u, v, w) = 0

(Sasaki 1958, Sherman 1978; Forthofer 2007), w = u dz/dx + v dz/dy on the ground, and sides and top open. Its Lagrange
multiplier solves a Poisson equation, D M^-1 D' multiplier = D first guess, and the wind is first guess - M^-1 D'
multiplier: D is the divergence, D' its transpose, M the weights.

Layers follow the ground and end at a level top. Components stand on the faces between cells, so the divergence of the
result vanishes in every cell as far as the equation is solved; the equation is symmetric, and conjugate gradients solve
it. Their preconditioner is the exact solution over level ground, by sines along rows and columns and the layers' own
modes: it needs more iterations for steeper ground, not for finer maps.

Rows grow south, v points north: v stands on the face north of its row. B worlds; G first guesses; K layers, upwards.
"""

import math
from collections.abc import Callable
from dataclasses import dataclass
from functools import cached_property

import torch
from torch import Tensor
from torch.nn.functional import pad

from warp_torchrl.system.modes import kept
from warp_torchrl.world.arrays.constants import numbers

Wind3 = tuple[Tensor, Tensor, Tensor]
"""u [B, G, K, H, W + 1], v [B, G, K, H + 1, W], w on the faces above each layer [B, G, K, H, W]."""
_SOLVED = 1e-12  # of the squared residual in the preconditioner's norm, at which a world's iteration stands still


@dataclass(frozen=True, eq=False)
class Mesh:
    """Layers over the ground of some worlds.

    Attributes:
        ground: Height of the ground, float32 [B, H, W] [m].
        sides: Of a cell from north to south and from west to east [m].
        thickness: Of each layer, as a share of the height between the ground and the top.
        top: Height of the top over the highest ground [m].
        alpha: Weight of horizontal changes over that of vertical ones: 1 in neutral air, less where air resists to be
            lifted and flows around hills (Sherman 1978).
    """

    ground: Tensor
    sides: tuple[float, float]
    thickness: tuple[float, ...]
    top: float
    alpha: float = 1.0

    @cached_property
    def depth(self) -> Tensor:
        """Return the height of the top over the ground, float32 [B, 1, 1, H, W] [m]."""
        return (self.ground.amax((1, 2), keepdim=True) + self.top - self.ground)[:, None, None]

    @cached_property
    def depth_at(self) -> tuple[Tensor, Tensor]:
        """Return the same on the faces of u and v [m]."""
        across, along = (
            pad(self.depth[:, 0], (1, 1, 0, 0), "replicate"),
            pad(self.depth[:, 0], (0, 0, 1, 1), "replicate"),
        )
        east, north = (across[..., 1:] + across[..., :-1]) / 2.0, (along[..., 1:, :] + along[..., :-1, :]) / 2.0
        return east[:, None], north[:, None]

    @cached_property
    def slope_at(self) -> tuple[Tensor, Tensor]:
        """Return how the ground rises to the east on the faces of u and to the north on those of v; 0 at the sides."""
        rise = self.ground[:, None, None]
        east, north = rise.diff(dim=-1) / self.sides[1], -rise.diff(dim=-2) / self.sides[0]
        return pad(east, (1, 1)), pad(north, (0, 0, 1, 1))

    @cached_property
    def layer(self) -> Tensor:
        """Return the layers' share of the depth, float32 [K, 1, 1]."""
        return numbers(self.thickness, self.ground.device)[:, None, None]

    @cached_property
    def apart(self) -> Tensor:
        """Return how far the middles of neighbouring layers lie apart, the last one from the top: shares, [K, 1, 1]."""
        return (self.layer + torch.cat((self.layer[1:], torch.zeros_like(self.layer[:1])))) / 2.0

    @cached_property
    def middle(self) -> Tensor:
        """Return the height of the layers' middles, shares of the depth, float32 [K, 1, 1]."""
        return self.layer.cumsum(0) - self.layer / 2.0

    @cached_property
    def tilt(self) -> Tensor:
        """Return the slope of the face above each layer, over the ground's, float32 [K, 1, 1]; 0 at the top."""
        return torch.cat((1.0 - self.layer.cumsum(0)[:-1], torch.zeros_like(self.layer[:1])))

    def divergence(self, wind: Wind3) -> Tensor:
        """Return the air that leaves each cell, over its area on the map, [B, G, K, H, W] [m/s]."""
        (u, v, w), (east, north), (rise, climb) = wind, self.depth_at, self.slope_at
        sideways = (u * east).diff(dim=-1) / self.sides[1] - (v * north).diff(dim=-2) / self.sides[0]
        up = (_across(u * rise) + _along(v * climb)) / 2.0
        above = torch.cat((up[:, :, 1:], torch.zeros_like(up[:, :, :1])), dim=2)
        through = w - self.tilt * (up + above) / 2.0
        return sideways * self.layer + through - pad(through, (0, 0, 0, 0, 1, 0))[:, :, :-1]

    def gradient(self, field: Tensor) -> Wind3:
        """Return the transpose of ``divergence`` over the weights: the change of the wind by a multiplier."""
        (east, north), (rise, climb) = self.depth_at, self.slope_at
        change = field - torch.cat((field[:, :, 1:], torch.zeros_like(field[:, :, :1])), dim=2)
        tilted = self.tilt * change
        tilted = (tilted + pad(tilted, (0, 0, 0, 0, 1, 0))[:, :, :-1]) / 4.0
        wide, high = pad(field, (1, 1)), pad(field, (0, 0, 1, 1))
        u = -wide.diff(dim=-1) * (east * self.layer / self.sides[1]) - rise * _across(pad(tilted, (1, 1)))
        v = high.diff(dim=-2) * (north * self.layer / self.sides[0]) - climb * _along(pad(tilted, (0, 0, 1, 1)))
        half_u, half_v = _halved(east, -1), _halved(north, -2)
        return u / (half_u * self.layer), v / (half_v * self.layer), change * self.alpha**2 / (self.depth * self.apart)

    def over_level_ground(self) -> Callable[[Tensor], Tensor]:
        """Return the solution over level ground of the same mean depth, as a function of the right side."""
        (height, width), device = self.ground.shape[1:], self.ground.device
        rows, across = _sines(height, self.sides[0], device), _sines(width, self.sides[1], device)
        modes, stiffness = _modes(self.thickness, device)
        depth = self.depth.mean((-1, -2), keepdim=True)
        horizontal = rows[1][:, None] + across[1]
        inverse = 1.0 / (depth * horizontal + self.alpha**2 * stiffness[:, None, None] / depth)

        def solve(right: Tensor) -> Tensor:
            seen = torch.einsum("km,bgkij->bgmij", modes, rows[0] @ (right @ across[0].T)) * inverse
            return torch.einsum("km,bgmij->bgkij", modes, rows[0].T @ (seen @ across[0]))

        return solve


def consistent(mesh: Mesh, guess: Wind3, iterations: int) -> Wind3:
    """Return the wind nearest to a first guess that keeps its mass.

    Args:
        mesh: The layers.
        guess: The first guess [m/s].
        iterations: Of conjugate gradients.
    """
    multiplier = _solved(
        lambda field: mesh.divergence(mesh.gradient(field)),
        mesh.over_level_ground(),
        mesh.divergence(guess),
        iterations,
    )
    u, v, w = mesh.gradient(multiplier)
    return guess[0] - u, guess[1] - v, guess[2] - w


def _solved(
    operator: Callable[[Tensor], Tensor], precondition: Callable[[Tensor], Tensor], right: Tensor, iterations: int
) -> Tensor:
    """Solve operator(x) = right by preconditioned conjugate gradients (Hestenes and Stiefel 1952), [B, G, K, H, W].

    A world that is solved stands still, whatever others need: its solution is the same in any batch.
    """
    found, left = torch.zeros_like(right), right
    towards = way = precondition(left)
    size = first = _dot(left, towards)
    for _ in range(iterations):
        ahead = operator(way)
        goes = size > _SOLVED * first
        step = torch.where(goes, size / _dot(way, ahead).clamp(min=1e-300), 0.0).float()
        found, left = found + step * way, left - step * ahead
        towards = precondition(left)
        before, size = size, torch.where(goes, _dot(left, towards), size)
        way = towards + (size / before.clamp(min=1e-300)).float() * way
    return found


def _dot(a: Tensor, b: Tensor) -> Tensor:
    """Return the inner product of each first guess, float64 [B, G, 1, 1, 1]."""
    return (a * b).double().sum(-1, keepdim=True).sum(-2, keepdim=True).sum(-3, keepdim=True)


def _across(field: Tensor) -> Tensor:
    """Return the sums of neighbours in a row."""
    return field[..., 1:] + field[..., :-1]


def _along(field: Tensor) -> Tensor:
    """Return the sums of neighbours in a column."""
    return field[..., 1:, :] + field[..., :-1, :]


def _halved(depth: Tensor, dim: int) -> Tensor:
    """Return the depth on faces, half of it on the outermost: the volume that each stands for, over a cell's area."""
    weights = torch.ones(depth.shape[dim], device=depth.device)
    weights[0] = weights[-1] = 0.5
    return depth * (weights if dim == -1 else weights[:, None])


@kept(16)
def _sines(cells: int, side: float, device: torch.device) -> tuple[Tensor, Tensor]:
    """Return the modes of cells in a row between open ends, as rows [n, n], and their eigenvalues [n] [1 / m2]."""
    number = torch.arange(1, cells + 1, dtype=torch.float64)
    modes = torch.sin(math.pi * number[:, None] * (number - 0.5) / cells) * math.sqrt(2.0 / cells)
    modes[-1] /= math.sqrt(2.0)
    values = (2.0 * torch.sin(math.pi * number / (2 * cells)) / side).square()
    return modes.to(device, torch.float32), values.to(device, torch.float32)


@kept(16)
def _modes(thickness: tuple[float, ...], device: torch.device) -> tuple[Tensor, Tensor]:
    """Return the modes of layers of some thickness, as columns [K, K], and their eigenvalues [K]."""
    mass = torch.tensor(thickness, dtype=torch.float64)
    couples = 2.0 / (mass + torch.cat((mass[1:], torch.zeros(1))))
    diagonal = couples + torch.cat((torch.zeros(1), couples[:-1]))
    stiffness = torch.diag(diagonal) - torch.diag(couples[:-1], 1) - torch.diag(couples[:-1], -1)
    values, vectors = torch.linalg.eigh(stiffness / (mass[:, None] * mass).sqrt())
    return (vectors / mass[:, None].sqrt()).to(device, torch.float32), values.to(device, torch.float32)
