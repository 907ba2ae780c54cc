"""The paper's automaton: its parameters, and what they make of the law's rules (``warp_torchrl.world.law.law``)."""

from dataclasses import dataclass
from typing import Literal

import torch
from torch import Tensor

from warp_torchrl.system.modes import kept
from warp_torchrl.validation import check_fields
from warp_torchrl.world.arrays.batch import Batch
from warp_torchrl.world.arrays.geometry import DISTANCES
from warp_torchrl.world.behaviour.fbp_fuels import FUEL_TYPES
from warp_torchrl.world.law import law
from warp_torchrl.world.law.automaton import Automaton, Beside, at_cells, of_codes
from warp_torchrl.world.law.wind_and_slope import alexandridis, ellipse, fbp, slope_factor
from warp_torchrl.world.state.state import Air, Ground, Landscape, WorldState


@dataclass(eq=False, repr=False)
class Slopes(Batch):
    """What the law makes of ground that is not flat."""

    slope: Tensor  # float32 [B,8,H+2,W+1], s_d into a cell, a margin about the map


@dataclass(eq=False, repr=False)
class Gains(Batch):
    """What the law makes of one wind for each world."""

    gain: Tensor  # float32 [B,8,1,1], w_d / distance_d


@dataclass(frozen=True, kw_only=True)
class Fire(Automaton):
    """The automaton of WARP-CA, law ``paper``.

    A burning cell ignites each neighbouring tree independently, per tick, with

        p_d = clip(alpha w_d s_d / dist_d, 0, 1)

    so that a tree's chance is q = 1 - prod (1 - p_d), joined with p_spont. The wind's factor w_d and the slope's s_d
    stand in ``warp_torchrl.world.law.wind_and_slope``.

    Attributes:
        alpha: Flammability of lake, wetland, grassland, forest and bare ground.
        kernel: The wind's factor: ``alexandridis``, ``ellipse`` or ``fbp``.
        wind_gain: c1 of ``alexandridis`` [s/m].
        wind_focus: c2 of ``alexandridis`` [s/m].
        head_gain: g of ``ellipse`` [s/m].
        head_fuel: Fuel type of the Canadian system whose heads ``fbp`` has.
        ffmc: Fine fuel moisture code of ``fbp``.
        slope_gain: a [1/degree].
        neighbours: 8 (Moore), or 4 (von Neumann) without the diagonal ones.
        diagonal: ``distance`` divides by the distance to the neighbour, ``unit`` treats all alike.
        wet_ticks: Ticks of the paper for which a tree that was put out cannot ignite.

    Raises:
        ValueError: If a value is out of its range.
    """

    alpha: tuple[float, float, float, float, float] = (0.0, 0.1, 1.0, 0.8, 0.0)
    kernel: Literal["alexandridis", "ellipse", "fbp"] = "alexandridis"
    wind_gain: float = 0.045
    wind_focus: float = 0.131
    head_gain: float = 0.16
    head_fuel: str = "C-7"
    ffmc: float = 94.0
    slope_gain: float = 0.078
    neighbours: Literal[4, 8] = 8
    diagonal: Literal["distance", "unit"] = "distance"
    wet_ticks: int = 10

    def __post_init__(self) -> None:
        super().__post_init__()
        check_fields(
            self,
            wind_gain=(0.0, 1.0),
            wind_focus=(0.0, 1.0),
            head_gain=(0.0, 1.0),
            ffmc=(50.0, 101.0),
            slope_gain=(0.0, 1.0),
            wet_ticks=(0, 255),
        )
        if self.head_fuel not in FUEL_TYPES:
            known = ", ".join(FUEL_TYPES)
            raise ValueError(f"head_fuel must be one of {known}, got {self.head_fuel!r}")
        if len(self.alpha) != 5 or not all(0.0 <= value <= 1.0 for value in self.alpha):
            raise ValueError(f"alpha must be five numbers in [0, 1], one a cover, got {list(self.alpha)}")

    @property
    def wet_for(self) -> int:
        """Return the ticks for which a tree that was put out cannot ignite."""
        return self.wet_ticks * self.ticks_per_stage

    @property
    def law(self) -> law.Clipped:
        """Return how the strengths of burning neighbours make a probability."""
        return law.Clipped()

    @property
    def directions(self) -> range:
        """Return the directions in which fire travels: all 8, or 4 without the diagonal ones."""
        return range(0, 8, 8 // self.neighbours)

    def flammability(self, landscape: Landscape) -> Tensor:
        """Return alpha of the ground, float32 [B, H, W] (WARP-CA, terrain table)."""
        return of_codes(tuple(self.alpha), landscape.cover)

    def wind_factor(self, wind: Tensor) -> Tensor:
        """Return the wind's factor, float32 [B, 8, h, w], of a wind [B, 2, h, w] [m/s] at the burning cell."""
        if self.kernel == "ellipse":
            return ellipse(wind, self.head_gain)
        if self.kernel == "fbp":
            return fbp(wind, self.head_fuel, self.ffmc)
        return alexandridis(wind, self.wind_gain, self.wind_focus)

    def gain(self, wind: Tensor) -> Tensor:
        """Return w_d / distance_d of a wind [B, 2, h, w] [m/s] at the burning cell, float32 [B, 8, h, w]."""
        factor = self.wind_factor(wind)
        return factor if self.diagonal == "unit" else factor * _nearness(wind.device)

    def ground(self, landscape: Landscape, cell_size: float, key: Tensor) -> Ground:
        """See ``Automaton``."""
        height = landscape.elevation
        terms = Batch() if height is None else Slopes(slope_factor(height, cell_size, self.slope_gain))
        return Ground(landscape, self.flammability(landscape), terms, cell_size)

    def air(self, wind: Tensor, moisture: Tensor | None, ground: Ground) -> Air:
        """See ``Automaton``. What differs from cell to cell is not kept: ``gain`` makes it anew."""
        return Air(wind, moisture, Gains(self.gain(wind)) if wind.shape[2:] == (1, 1) else Batch())

    def spread_probability(self, state: WorldState) -> Tensor:
        """Return each tree's probability to be ignited by its neighbours in one tick, float32 [B, H, W]."""
        gain, burns = self.gain_in(state), self.spreads(state).to(torch.float32)
        return law.spread_probability(
            self.law, burns, self._susceptible(state), gain, _slope_into_cell(state), self.directions
        )

    def ignition_probability(self, state: WorldState) -> Tensor:
        """Return each tree's probability to ignite in the next tick, p_spont + (1 - p_spont) p_spread.

        float32 [B, H, W], 0 where nothing can ignite.
        """
        spread = self.spread_probability(state)
        if self.beta == 0.0:
            return spread
        spontaneous = self.spontaneous(state)
        return spontaneous + (1.0 - spontaneous) * spread

    def expected_ignitions(self, state: WorldState) -> Tensor:
        """Return how many neighbours each burning cell is expected to ignite in one tick, float32 [B, H, W]; else 0."""
        expected = law.expected_ignitions(
            self.law, self._susceptible(state), self.gain_in(state), _slope_into_cell(state), self.directions
        )
        return expected * self.spreads(state)

    def ignition_beside(self, state: WorldState, beside: Beside, rate: Tensor, air: Air) -> Tensor:
        """Return 1 - prod_d (1 - pi_d p_d), pi_d the chance of a source: see ``Automaton``."""
        gain = self.gain(air.wind).unflatten(0, rate.shape)
        alpha = self.faster(beside.of(state.alpha)[:, None], rate[..., None])
        susceptible, slope = self.law.susceptibility(alpha), _slope_into_cell(state)
        spared = torch.ones_like(susceptible)
        for d in self.directions:
            strength = susceptible * self._at_source(gain[:, :, d], beside, d)
            if slope is not None:
                strength = strength * beside.of(slope[:, d])[:, None]
            p = self.law.probability(self.law.join(torch.zeros_like(strength), strength))
            spared = spared * (1.0 - beside.spreads[:, None, d] * p)
        return 1.0 - spared

    def _at_source(self, gain: Tensor, beside: Beside, direction: int) -> Tensor:
        """Return the gain at the sources, float32 [B, P, n or 1], of one wind or of that of each cell."""
        if gain.shape[2:] == (1, 1):
            return gain[..., 0]
        return at_cells(gain, beside.source(direction, gain.shape[3], gain[0, 0].numel()))

    def gain_in(self, state: WorldState) -> Tensor:
        """Return w_d / distance_d at the source in some worlds, float32 [B, 8, h, w]."""
        terms = state.air.terms
        return terms.gain if isinstance(terms, Gains) else self.gain(state.wind)

    def _susceptible(self, state: WorldState) -> Tensor:
        return self.law.susceptibility(state.alpha) * self.is_fuel(state)


def slope_in(state: WorldState) -> Tensor | None:
    """Return s_d into each cell with a margin about the map, float32 [B, 8, H + 2, W + 1]; None where all is flat."""
    terms = state.ground.terms
    return terms.slope if isinstance(terms, Slopes) else None


def _slope_into_cell(state: WorldState) -> Tensor | None:
    """Return s_d into each cell by direction of travel, float32 [B, 8, H, W]; None where all is flat."""
    slope = slope_in(state)
    return None if slope is None else slope[:, :, 1:-1, :-1]


@kept(8)
def _nearness(device: torch.device) -> Tensor:
    """Return 1 / distance to the neighbour in each direction, float32 [8, 1, 1]."""
    return torch.tensor([1.0 / distance for distance in DISTANCES], device=device)[:, None, None]
