"""Hills in the wind: what each cell's wind is of one wind over the whole map, from the ground's elevation.

A mass-consistent wind is linear in its first guess, so two solutions, for a wind to the east and one to the north, give
that of any wind: four factors a cell, which landscapes hold as layers.
"""

import math
from dataclasses import dataclass
from functools import lru_cache

import torch
from torch import Tensor
from torch.nn.functional import adaptive_avg_pool2d, interpolate

from warp_torchrl.validation import check_fields
from warp_torchrl.world.air.mass_consistency import Mesh, Wind3, consistent
from warp_torchrl.world.state.state import Landscape

FACTORS = ("wind_east_to_east", "wind_east_to_north", "wind_north_to_east", "wind_north_to_north")
"""Layers of a landscape: east and north component of a cell's wind, of a wind to the east and of one to the north."""
_CELLS_AT_ONCE = {"cpu": 2**17, "cuda": 2**24}
"""Of air, whose wind is found together: on a CPU what its cache holds."""
_HEIGHT = 10.0  # m, of the wind
_FIRST_LAYER = 8.0  # m
_LEAST_TOP = 500.0  # m
_PROFILE_ENDS = 1000.0  # m over the ground, where the wind grows no more: the depth of a day's boundary layer


@dataclass(frozen=True, kw_only=True)
class Hills:
    """How hills bend a wind.

    The first guess has the speed of a logarithmic profile, ln(z / roughness), up to 1000 m over the ground, and one
    bearing everywhere. The air ends half the map's shorter side over the highest ground, at least 500 m.

    Attributes:
        roughness: Roughness length of the ground [m]; 0 gives the first guess one speed at all heights.
        alpha: Weight of horizontal changes over that of vertical ones: 1 in neutral air; less in stable air, which
            flows around hills more than over them.
        layers: Layers of air.
        columns: Most columns of air; cells of larger maps are joined for the wind, which is interpolated then.
        iterations: Of the solver.

    Raises:
        ValueError: If a value is out of its range.
    """

    roughness: float = 0.1
    alpha: float = 1.0
    layers: int = 20
    columns: int = 65536
    iterations: int = 16

    def __post_init__(self) -> None:
        check_fields(
            self,
            roughness=(0.0, 2.0),
            alpha=(0.05, 5.0),
            layers=(4, 100),
            columns=(16, 2**22),
            iterations=(1, 1000),
        )

    def shaped(self, ground: Landscape, cell_size: float) -> Landscape:
        """Return landscapes with the layers ``FACTORS``, float32 [B, H, W]; level ones as they are."""
        if ground.elevation is None:
            return ground
        factors = self.factors(ground.elevation, cell_size)
        return ground.with_layers(**dict(zip(FACTORS, factors.unbind(1), strict=True)))

    def factors(self, elevation: Tensor, cell_size: float) -> Tensor:
        """Return what a wind of 1 m/s to the east, and one to the north, is in each cell at 10 m.

        Args:
            elevation: float32 [B, H, W] [m].
            cell_size: Side of a cell [m].

        Returns:
            (u, v) of the one and (u, v) of the other, float32 [B, 4, H, W].
        """
        made = self.mesh(elevation[:1], cell_size).depth
        at_once = max(1, _CELLS_AT_ONCE["cuda" if made.is_cuda else "cpu"] // (made.numel() * self.layers))
        parts = [self._factors(each, cell_size) for each in elevation.split(at_once)]
        return parts[0] if len(parts) == 1 else torch.cat(parts)

    def _factors(self, elevation: Tensor, cell_size: float) -> Tensor:
        mesh = self.mesh(elevation, cell_size)
        return self._at_height(mesh, self.wind(mesh), (elevation.shape[1], elevation.shape[2]))

    def mesh(self, elevation: Tensor, cell_size: float) -> Mesh:
        """Return the layers over the ground, whose columns are cells or whole groups of them."""
        height, width = elevation.shape[1:]
        joined = max(1, math.ceil(math.sqrt(height * width / self.columns)))
        rows, columns = math.ceil(height / joined), math.ceil(width / joined)
        ground = elevation if joined == 1 else adaptive_avg_pool2d(elevation[:, None], (rows, columns))[:, 0]
        top = max(_LEAST_TOP, min(height, width) * cell_size / 2.0)
        sides = (height * cell_size / rows, width * cell_size / columns)
        return Mesh(ground, sides, _thickness(self.layers, top), top, self.alpha)

    def wind(self, mesh: Mesh) -> Wind3:
        """Return the winds whose first guesses blow with 1 m/s at 10 m to the east, and to the north."""
        east, north = (self._profile(mesh.middle * depth) for depth in mesh.depth_at)
        none = torch.zeros_like(mesh.depth * mesh.middle)
        guess = (
            torch.cat((east, torch.zeros_like(east)), dim=1),
            torch.cat((torch.zeros_like(north), north), dim=1),
            torch.cat((none, none), dim=1),
        )
        return consistent(mesh, guess, self.iterations)

    def _profile(self, height: Tensor) -> Tensor:
        """Return the speed of the first guess at some heights over the ground [m], 1 at 10 m."""
        if self.roughness == 0.0:
            return torch.ones_like(height)
        scaled = (height.clamp(max=_PROFILE_ENDS) / self.roughness).clamp(min=1.0 + 1e-3)
        return scaled.log() / math.log(_HEIGHT / self.roughness)

    def _at_height(self, mesh: Mesh, wind: Wind3, size: tuple[int, int]) -> Tensor:
        """Return the wind at 10 m over the first guess there, by the share of the layers about it, in each cell."""
        east = (wind[0][..., 1:] + wind[0][..., :-1]) / 2.0
        north = (wind[1][..., 1:, :] + wind[1][..., :-1, :]) / 2.0
        share = torch.stack((east, north), dim=2) / self._profile(mesh.middle * mesh.depth)[:, :, None]
        place = (_HEIGHT / mesh.depth[:, 0, 0]).clamp(min=float(mesh.middle[0]))
        middles = mesh.middle.flatten()
        above = torch.searchsorted(middles, place.contiguous(), right=True).clamp(1, len(middles) - 1)
        low, high = middles[above - 1], middles[above]
        part = ((place - low) / (high - low))[:, None, None, None]
        index = above[:, None, None, None].expand(-1, 2, 2, 1, -1, -1)
        lower, upper = share.gather(3, index - 1), share.gather(3, index)
        found = (lower + part * (upper - lower))[:, :, :, 0].flatten(1, 2)
        return found if found.shape[2:] == size else interpolate(found, size, mode="bilinear", align_corners=False)


def bent(wind: Tensor, ground: Landscape) -> Tensor:
    """Return the wind of each cell of one over the whole map.

    Args:
        wind: float32 [B, 2, 1, 1] or [B, 2, H, W] [m/s].
        ground: Landscapes, batch size [B] or [1]; without ``FACTORS`` the wind is the same everywhere.
    """
    if ground.layer(FACTORS[0]) is None:
        return wind
    a, b, c, d = (ground.layers.held[name] for name in FACTORS)
    east, north = wind[:, 0], wind[:, 1]
    return torch.stack((a * east + c * north, b * east + d * north), dim=1)


@lru_cache(64)
def _thickness(layers: int, top: float) -> tuple[float, ...]:
    """Return the shares of layers of which each is thicker than the one below by the same factor, the first 8 m."""
    low, high = 1.0, 10.0
    for _ in range(60):
        ratio = (low + high) / 2.0
        low, high = (ratio, high) if _FIRST_LAYER * (ratio**layers - 1.0) / (ratio - 1.0) < top else (low, ratio)
    each = [ratio**number for number in range(layers)]
    return tuple(share / sum(each) for share in each)
