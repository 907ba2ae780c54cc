"""The fire's laws: growth, spread, spontaneous ignition, burning and regrowth.

One synchronous tick, all from the state before it (WARP-CA, cellular automaton). The laws are pure functions of the
state and of one uniform draw a cell.
"""

import math
from dataclasses import dataclass
from functools import lru_cache
from typing import Literal

import torch
from torch import Tensor
from torch.nn.functional import pad

from warp_torchrl.world.geometry import DIRECTIONS, DISTANCES, unit_vectors
from warp_torchrl.world.landscape import holds_trees
from warp_torchrl.world.state import EMBER, FIRST_FIRE, OLDEST, WorldState, is_burning, is_tree
from warp_torchrl.world.validation import check_fields


@dataclass(frozen=True, kw_only=True)
class Fire:
    """The automaton of WARP-CA.

    A burning cell ignites each neighbouring tree independently, per tick, with

        p_d = clip(alpha w_d s_d / dist_d, 0, 1)
        w_d = exp(c1 V) exp(c2 V (cos theta - 1))           (Alexandridis et al. 2008)
        s_d = exp(a slope), slope in degrees from source to target

    so that a tree's chance is q = 1 - prod (1 - p_d), joined with p_spont.

    Attributes:
        growth: Whether trees age, age + 1 with p = exp(-age / S_max tau); S_max is 10.
        tau: Growth constant.
        beta: Spontaneous ignition, p = beta exp(10 age / S_max) / exp(10) / (H W) for each tree.
        p_regrow: Chance a tick that empty ground grows a tree of age 1.
        youngest_fuel: A_min, the age from which a tree can ignite.
        burning_stages: Stages that spread: 4, the last stage being an ember that is seen and does not spread; or 5.
        alpha: Flammability of lake, wetland, grassland, forest and bare ground.
        wind_gain: c1 [s/m].
        wind_focus: c2 [s/m].
        slope_gain: a [1/degree].
        diagonal: ``distance`` divides by the distance to the neighbour, ``unit`` treats all eight alike.
        wet_ticks: Ticks for which a tree that was put out cannot ignite.

    Raises:
        ValueError: If a value is out of its range.
    """

    growth: bool = False
    tau: float = 5.0
    beta: float = 0.0
    p_regrow: float = 0.0
    youngest_fuel: int = 2
    burning_stages: int = 4
    alpha: tuple[float, float, float, float, float] = (0.0, 0.1, 1.0, 0.8, 0.0)
    wind_gain: float = 0.045
    wind_focus: float = 0.131
    slope_gain: float = 0.078
    diagonal: Literal["distance", "unit"] = "distance"
    wet_ticks: int = 10

    def __post_init__(self) -> None:
        check_fields(
            self,
            tau=(0.0, 100.0),
            beta=(0.0, 1e6),
            p_regrow=(0.0, 1.0),
            youngest_fuel=(1, OLDEST),
            burning_stages=(4, 5),
            wind_gain=(0.0, 1.0),
            wind_focus=(0.0, 1.0),
            slope_gain=(0.0, 1.0),
            wet_ticks=(0, 255),
        )
        if len(self.alpha) != 5 or not all(0.0 <= value <= 1.0 for value in self.alpha):
            raise ValueError(f"alpha must be five numbers in [0, 1], one a cover, got {list(self.alpha)}")

    @property
    def last_spreading(self) -> int:
        """Return the cell code of the last stage that spreads and can be put out."""
        return FIRST_FIRE + self.burning_stages - 1

    @property
    def burns_out(self) -> bool:
        """Return whether a world without fire stays so: an episode may end early."""
        return self.beta == 0.0

    def flammability(self, cover: Tensor) -> Tensor:
        """Return alpha of the ground, float32, shape of ``cover`` (WARP-CA, terrain table)."""
        return _constant(tuple(self.alpha), cover.device)[cover.to(torch.int64)]

    def slope_factor(self, elevation: Tensor, cell_size: float) -> Tensor:
        """Return how the ground helps a fire that travels in each direction into each cell.

            s_d = exp(a slope),  slope = arctan((z_target - z_source) / distance) in degrees

        Args:
            elevation: float32 [B, H, W] [m].
            cell_size: Side of a cell [m].

        Returns:
            float32 [B, 8, H + 1, W + 1]: the last row and column are margin, as ``spread`` lays the map out.
        """
        ground = pad(elevation[:, None], (1, 1, 1, 1), mode="replicate")[:, 0]
        height, width = elevation.shape[1:]
        factors = []
        for (row, column), distance in zip(DIRECTIONS, DISTANCES, strict=True):
            source = ground[:, 1 - row : 1 - row + height, 1 - column : 1 - column + width]
            slope = torch.atan((elevation - source) / (distance * cell_size)) * (180.0 / math.pi)
            factors.append(_factor(self.slope_gain * slope))
        return pad(torch.stack(factors, dim=1), (0, 1, 0, 1))

    def wind_factor(self, wind: Tensor) -> Tensor:
        """Return how the wind at a burning cell helps its fire in each direction.

            w_d = exp(c1 V) exp(c2 V (cos theta_d - 1))      (Alexandridis et al. 2008, eq. 4)

        Args:
            wind: (u, v) at the source, float32 [B, 2, h, w] [m/s]; h = w = 1 for a uniform wind.

        Returns:
            float32 [B, 8, h, w].
        """
        speed = torch.linalg.vector_norm(wind, dim=1, keepdim=True)
        u, v = wind[:, :1], wind[:, 1:]
        east, north = _directions(wind.device)
        along = u * east[:, None, None] + v * north[:, None, None]
        return _factor((self.wind_gain - self.wind_focus) * speed + self.wind_focus * along)

    def spread(self, state: WorldState, expected: bool = False) -> tuple[Tensor, Tensor | None]:
        """Return each tree's chance to be ignited by its neighbours in one tick.

            q = 1 - prod_d (1 - p_d), accumulated as q + p_d (1 - q), which keeps 0, 1 and small numbers exact

        The maps lie in one row with a margin column and row after each, so that all eight neighbours are contiguous
        slices at constant offsets.

        Args:
            state: The worlds.
            expected: Whether to sum each p_d at its source as well.

        Returns:
            Chance float32 [B, H, W], 0 where nothing can ignite; and the number of neighbours that each burning cell
            is expected to ignite, float32 [B, H, W], or None.
        """
        cells = state.cells
        worlds, height, width = cells.shape
        spreading = is_burning(cells) & (cells <= self.last_spreading)
        margin = width + 2
        size = worlds * (height + 1) * (width + 1)
        source = _in_a_row(spreading.to(torch.float32), margin)
        target = pad(state.alpha * self.is_fuel(state), (0, 1, 0, 1)).view(worlds, -1)
        wind = self.wind_factor(state.wind)
        uniform_wind = wind.shape[2:] == (1, 1)
        q, p, spared = torch.zeros_like(target), torch.empty_like(target), torch.empty_like(target)
        one = torch.ones((), device=cells.device)
        sum_at_source = torch.zeros_like(source) if expected else None
        for direction, ((row, column), distance) in enumerate(zip(DIRECTIONS, DISTANCES, strict=True)):
            start = margin - row * (width + 1) - column
            here = slice(start, start + size)
            gain = 1.0 if self.diagonal == "unit" else 1.0 / distance
            if uniform_wind:
                torch.mul(source[here].view_as(target), wind[:, direction, :, 0] * gain, out=p)
            else:
                blown = spreading * wind[:, direction] * gain
                p = _in_a_row(blown, margin)[here].view_as(target)
            p.mul_(target)
            if state.slope is not None:
                p *= state.slope[:, direction].reshape(worlds, -1)
            p.clamp_(max=1.0)
            if sum_at_source is not None:
                sum_at_source[here] += p.view(-1)
            q.add_(torch.sub(one, q, out=spared).mul_(p))

        def on_map(row_of_maps: Tensor) -> Tensor:
            return row_of_maps.view(worlds, height + 1, width + 1)[:, :height, :width].contiguous()

        if sum_at_source is None:
            return on_map(q), None
        return on_map(q), on_map(sum_at_source[margin : margin + size])

    def chance_to_ignite(self, state: WorldState) -> Tensor:
        """Return each tree's chance to ignite in the next tick, q = p_spont + (1 - p_spont) p_spread.

        float32 [B, H, W], 0 where nothing can ignite.
        """
        return self._join(state, self.spread(state)[0])

    def threat(self, state: WorldState) -> Tensor:
        """Return where the fire is about to grow, float32 [B, H, W] in 0..1.

        Of a burning cell, the neighbours that it is expected to ignite in a tick, / 4, at most 1; of a tree, its
        chance to ignite in the next tick.
        """
        q, expected = self.spread(state, expected=True)
        return torch.where(is_burning(state.cells), (expected * 0.25).clamp_(max=1.0), self._join(state, q))

    def _join(self, state: WorldState, spread: Tensor) -> Tensor:
        """Join the chance to be ignited by neighbours with that of spontaneous ignition."""
        if self.beta == 0.0:
            return spread
        cells = state.cells
        fuel = self.is_fuel(state) & (state.alpha > 0.0)
        spontaneous = self._look_up(self._spontaneous(cells.shape[1] * cells.shape[2]), cells) * fuel
        return spontaneous + (1.0 - spontaneous) * spread

    def is_fuel(self, state: WorldState) -> Tensor:
        """Return which trees can ignite now: age >= A_min, dry; bool [B, H, W]."""
        return is_tree(state.cells) & (state.cells >= self.youngest_fuel) & (state.wet == 0)

    def tick(self, state: WorldState, u: Tensor, due: Tensor) -> WorldState:
        """Advance the fire by one tick where it is due.

        Ignition, growth and regrowth exclude each other in a cell, so one uniform serves all: ignite iff u < q;
        else grow iff u >= 1 - (1 - q) p_grow.

        Args:
            state: The worlds before the tick.
            u: Uniform draws in [0, 1), float32 [B, H, W].
            due: Which worlds tick, bool [B].

        Returns:
            The worlds after it, with new ``cells``, ``age``, ``burned``, ``wet`` and ``tick``.
        """
        cells, due = state.cells, due[:, None, None]
        burning = is_burning(cells) & due
        q = self.chance_to_ignite(state)
        ignite = (u < q) & due
        to_ash = burning & (cells == EMBER)
        after = cells + burning
        if self.growth:
            grow = (u >= 1.0 - (1.0 - q) * self._look_up(self._growth(), cells)) & is_tree(cells) & due & ~ignite
            after += grow & (cells < OLDEST)
        after = torch.where(ignite, FIRST_FIRE, after).masked_fill_(to_ash, 0)
        if self.p_regrow > 0.0:
            bare = (cells == 0) & holds_trees(state.landscape.cover) & ~state.firebreak & due
            after += bare & (u < self.p_regrow)
        return state.replace(
            cells=after,
            age=torch.where(ignite, cells, state.age).masked_fill_(to_ash, 0),
            burned=state.burned | to_ash,
            wet=state.wet - ((state.wet > 0) & due).to(torch.uint8),
            tick=state.tick + due[:, 0, 0],
        )

    def _growth(self) -> tuple[float, ...]:
        """Return p_grow of each cell code, exp(-age / S_max tau) (WARP-CA, growth)."""
        return tuple(math.exp(-code / OLDEST * self.tau) if 1 <= code < OLDEST else 0.0 for code in range(EMBER + 1))

    def _spontaneous(self, cells: int) -> tuple[float, ...]:
        """Return p_spont of each cell code, beta exp(10 age / S_max - 10) / (H W) (WARP-CA, spontaneous ignition)."""

        def chance(code: int) -> float:
            return min(1.0, self.beta * math.exp(10.0 * code / OLDEST - 10.0) / cells)

        return tuple(chance(code) if 1 <= code <= OLDEST else 0.0 for code in range(EMBER + 1))

    def _look_up(self, table: tuple[float, ...], cells: Tensor) -> Tensor:
        return _constant(table, cells.device)[cells.to(torch.int64)]


def _factor(exponent: Tensor) -> Tensor:
    """Return exp of it, kept so that no product of two factors leaves float32: a chance is clipped at 1 anyway."""
    return torch.exp(exponent.clamp(-40.0, 40.0))


def _in_a_row(maps: Tensor, margin: int) -> Tensor:
    """Lay [B, H, W] maps out in one row, each with a zero column and row after it and a margin at both ends."""
    return pad(pad(maps, (0, 1, 0, 1)).flatten(), (margin, margin))


@lru_cache(maxsize=64)
def _constant(values: tuple[float, ...], device: torch.device) -> Tensor:
    return torch.tensor(values, dtype=torch.float32, device=device)


@lru_cache(maxsize=8)
def _directions(device: torch.device) -> tuple[Tensor, Tensor]:
    vectors = unit_vectors(device)
    return vectors[:, 0].contiguous(), vectors[:, 1].contiguous()
