"""The automaton: its parameters, and what they make of the law's rules (``warp_torchrl.world.law``)."""

from collections.abc import Callable
from dataclasses import dataclass
from functools import lru_cache
from typing import Literal

import torch
from torch import Tensor

from warp_torchrl.validation import check_fields
from warp_torchrl.world import law
from warp_torchrl.world.geometry import DISTANCES
from warp_torchrl.world.state import EMBER, FIRST_FIRE, OLDEST, Air, Ground, Landscape, WorldState
from warp_torchrl.world.terrain.landscape import holds_trees
from warp_torchrl.world.wind_and_slope import alexandridis, ellipse, slope_factor


@dataclass(frozen=True, kw_only=True)
class Fire:
    """The automaton of WARP-CA, law ``paper``.

    A burning cell ignites each neighbouring tree independently, per tick, with

        p_d = clip(alpha w_d s_d / dist_d, 0, 1)

    so that a tree's chance is q = 1 - prod (1 - p_d), joined with p_spont. The wind's factor w_d and the slope's s_d
    stand in ``warp_torchrl.world.wind_and_slope``.

    Attributes:
        growth: Whether trees age, age + 1 with p = exp(-age / S_max tau); S_max is 10.
        tau: Growth constant.
        beta: Spontaneous ignition, p = beta exp(10 age / S_max) / exp(10) / (H W) for each tree.
        p_regrow: Chance a tick that empty ground grows a tree of age 1.
        youngest_fuel: A_min, the age from which a tree can ignite.
        burning_stages: Stages that spread: 4, the last stage being an ember that is seen and does not spread; or 5.
        alpha: Flammability of lake, wetland, grassland, forest and bare ground.
        kernel: The wind's factor: ``alexandridis`` or ``ellipse``.
        wind_gain: c1 of ``alexandridis`` [s/m].
        wind_focus: c2 of ``alexandridis`` [s/m].
        head_gain: g of ``ellipse`` [s/m].
        slope_gain: a [1/degree].
        neighbours: 8 (Moore), or 4 (von Neumann) without the diagonal ones.
        diagonal: ``distance`` divides by the distance to the neighbour, ``unit`` treats all alike.
        wet_ticks: Ticks of the paper for which a tree that was put out cannot ignite.

    Raises:
        ValueError: If a value is out of its range.
    """

    growth: bool = False
    tau: float = 5.0
    beta: float = 0.0
    p_regrow: float = 0.0
    youngest_fuel: int = 2
    burning_stages: Literal[4, 5] = 4
    alpha: tuple[float, float, float, float, float] = (0.0, 0.1, 1.0, 0.8, 0.0)
    kernel: Literal["alexandridis", "ellipse"] = "alexandridis"
    wind_gain: float = 0.045
    wind_focus: float = 0.131
    head_gain: float = 0.16
    slope_gain: float = 0.078
    neighbours: Literal[4, 8] = 8
    diagonal: Literal["distance", "unit"] = "distance"
    wet_ticks: int = 10

    def __post_init__(self) -> None:
        check_fields(
            self,
            tau=(0.0, 100.0),
            beta=(0.0, 1e6),
            p_regrow=(0.0, 1.0),
            youngest_fuel=(1, OLDEST),
            wind_gain=(0.0, 1.0),
            wind_focus=(0.0, 1.0),
            head_gain=(0.0, 1.0),
            slope_gain=(0.0, 1.0),
            wet_ticks=(0, 255),
        )
        if len(self.alpha) != 5 or not all(0.0 <= value <= 1.0 for value in self.alpha):
            raise ValueError(f"alpha must be five numbers in [0, 1], one a cover, got {list(self.alpha)}")

    @property
    def ticks_per_stage(self) -> int:
        """Return the ticks that a burning stage lasts, and that make one of the paper's."""
        return 1

    @property
    def last_spreading(self) -> int:
        """Return the cell code of the last stage that spreads and can be put out."""
        return FIRST_FIRE + self.burning_stages - 1

    @property
    def wet_for(self) -> int:
        """Return the ticks for which a tree that was put out cannot ignite."""
        return self.wet_ticks * self.ticks_per_stage

    @property
    def burns_out(self) -> bool:
        """Return whether a world without fire stays so: an episode may end early."""
        return self.beta == 0.0

    @property
    def law(self) -> law.Clipped:
        """Return how the strengths of burning neighbours make a probability."""
        return law.Clipped()

    @property
    def directions(self) -> range:
        """Return the directions in which fire travels: all 8, or 4 without the diagonal ones."""
        return range(0, 8, 8 // self.neighbours)

    def flammability(self, cover: Tensor) -> Tensor:
        """Return alpha of the ground, float32, shape of ``cover`` (WARP-CA, terrain table)."""
        return _of_codes(tuple(self.alpha), cover)

    def wind_factor(self, wind: Tensor) -> Tensor:
        """Return the wind's factor, float32 [B, 8, h, w], of a wind [B, 2, h, w] [m/s] at the burning cell."""
        if self.kernel == "ellipse":
            return ellipse(wind, self.head_gain)
        return alexandridis(wind, self.wind_gain, self.wind_focus)

    def gain(self, wind: Tensor) -> Tensor:
        """Return w_d / distance_d of a wind [B, 2, h, w] [m/s] at the burning cell, float32 [B, 8, h, w]."""
        factor = self.wind_factor(wind)
        return factor if self.diagonal == "unit" else factor * _nearness(wind.device)

    def ground(self, landscape: Landscape, cell_size: float) -> Ground:
        """Return landscapes with all that follows from them for the fire; a cell's side is in metres."""
        height = landscape.elevation
        slope = None if height is None else slope_factor(height, cell_size, self.slope_gain)
        return Ground(landscape=landscape, alpha=self.flammability(landscape.cover), slope=slope)

    def air(self, wind: Tensor) -> Air:
        """Return a wind, float32 [B, 2, 1, 1] or [B, 2, H, W] [m/s], with all that follows from it for the fire.

        What differs from cell to cell is not kept: ``gain`` makes it anew.
        """
        return Air(wind=wind, gain=self.gain(wind) if wind.shape[2:] == (1, 1) else None)

    def spreads(self, state: WorldState) -> Tensor:
        """Return which cells burn and ignite others, bool [B, H, W]."""
        return (state.cells >= FIRST_FIRE) & (state.cells <= self.last_spreading)

    def is_fuel(self, state: WorldState) -> Tensor:
        """Return which trees can ignite now: age >= A_min, dry; bool [B, H, W]."""
        return (state.cells >= self.youngest_fuel) & (state.cells <= OLDEST) & (state.wet == 0)

    def spread_probability(self, state: WorldState) -> Tensor:
        """Return each tree's probability to be ignited by its neighbours in one tick, float32 [B, H, W]."""
        gain, burns = self.gain_in(state), self.spreads(state).to(torch.float32)
        return law.spread_probability(
            self.law, burns, self._susceptible(state), gain, state.ground.slope_into_cell, self.directions
        )

    def ignition_probability(self, state: WorldState) -> Tensor:
        """Return each tree's probability to ignite in the next tick, p_spont + (1 - p_spont) p_spread.

        float32 [B, H, W], 0 where nothing can ignite.
        """
        spread = self.spread_probability(state)
        if self.beta == 0.0:
            return spread
        can = self.is_fuel(state) & (state.alpha > 0.0)
        spontaneous = _of_codes(self.lightning(state.cells[0].numel()), state.cells) * can
        return spontaneous + (1.0 - spontaneous) * spread

    def expected_ignitions(self, state: WorldState) -> Tensor:
        """Return how many neighbours each burning cell is expected to ignite in one tick, float32 [B, H, W]; else 0."""
        expected = law.expected_ignitions(
            self.law, self._susceptible(state), self.gain_in(state), state.ground.slope_into_cell, self.directions
        )
        return expected * self.spreads(state)

    def tick(self, state: WorldState, u: Tensor, ticks_now: Tensor) -> WorldState:
        """Advance the fire by one tick in the worlds that tick now.

        Args:
            state: The worlds before the tick.
            u: Uniform draws in [0, 1), float32 [B, H, W].
            ticks_now: Which worlds tick, bool [B].

        Returns:
            The worlds after it, with new ``cells``, ``age``, ``stage_age``, ``burned``, ``wet`` and ``tick``.
        """
        fertile = (state.cells == 0) & holds_trees(state.cover) & (state.firebreak == 0)
        return law.tick(
            state,
            u,
            ticks_now,
            q=self.ignition_probability(state),
            grow=_of_codes(self.growing(), state.cells),
            regrow=fertile * law.in_finer_time(self.p_regrow, self.ticks_per_stage),
            stage=self.ticks_per_stage,
        )

    def growing(self) -> tuple[float, ...]:
        """Return p_grow in one tick of each cell code, 0..15."""
        return self._by_code(lambda age: law.growth_probability(age, self.tau) if self.growth else 0.0)

    def lightning(self, cells: int) -> tuple[float, ...]:
        """Return p_spont in one tick of each cell code, 0..15, on a map of so many cells."""
        return self._by_code(lambda age: law.lightning_probability(age, self.beta, cells))

    def _by_code(self, rule: Callable[[int], float]) -> tuple[float, ...]:
        return tuple(law.in_finer_time(rule(code), self.ticks_per_stage) for code in range(EMBER + 1))

    def gain_in(self, state: WorldState) -> Tensor:
        """Return w_d / distance_d at the source in some worlds, float32 [B, 8, h, w]."""
        return self.gain(state.wind) if state.air.gain is None else state.air.gain

    def _susceptible(self, state: WorldState) -> Tensor:
        return self.law.susceptibility(state.alpha) * self.is_fuel(state)


def _of_codes(table: tuple[float, ...], codes: Tensor) -> Tensor:
    """Return what a table holds for each code, float32, shape of the codes."""
    values = torch.tensor(table, device=codes.device)
    return values.index_select(0, codes.flatten().to(torch.int32)).view(codes.shape)


@lru_cache(maxsize=8)
def _nearness(device: torch.device) -> Tensor:
    """Return 1 / distance to the neighbour in each direction, float32 [8, 1, 1]."""
    return torch.tensor([1.0 / distance for distance in DISTANCES], device=device)[:, None, None]
