"""The fire's automaton: growth, spread, spontaneous ignition, burning and regrowth.

One synchronous tick, all from the state before it (WARP-CA, cellular automaton). The rules are pure functions of the
state and of one uniform draw a cell.
"""

from dataclasses import dataclass
from typing import Literal

import torch
from torch import Tensor
from torch.compiler import is_compiling

from warp_torchrl.validation import check_fields
from warp_torchrl.world.constants import numbers
from warp_torchrl.world.edge import ByPattern, ByStrength, Edge, EdgeChances, edge_of, expected_from_edge
from warp_torchrl.world.flags import (
    above,
    as_mask,
    at_least,
    below,
    between,
    byte,
    choose,
    clear,
    equal,
    like,
    look_up,
    narrow,
    number,
    put,
    wide,
)
from warp_torchrl.world.kernel import alexandridis, ellipse, slope_factor
from warp_torchrl.world.landscape import holds_trees
from warp_torchrl.world.law import Clipped, Law
from warp_torchrl.world.pattern import chance_by_pattern, pattern_table
from warp_torchrl.world.rates import growth, in_a_tick, spontaneous_ignition
from warp_torchrl.world.spread import expected_ignitions, gains, ignition_chance
from warp_torchrl.world.state import EMBER, FIRST_FIRE, OLDEST, WorldState, is_burning


@dataclass(frozen=True, kw_only=True)
class Fire:
    """The automaton of WARP-CA, law ``paper``.

    A burning cell ignites each neighbouring tree independently, per tick, with

        p_d = clip(alpha w_d s_d / dist_d, 0, 1)

    so that a tree's chance is q = 1 - prod (1 - p_d), joined with p_spont. The wind's factor w_d and the slope's s_d
    stand in ``warp_torchrl.world.kernel``.

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

    def keeps_to_its_edge(self, state: WorldState) -> bool:
        """Return whether a tick is worked out at the fire's edge alone: ``edge``, ``tick_at_edge`` and ``outlook``.

        It is so where trees neither grow nor ignite by themselves, on a CPU, unless whole maps are fused.
        """
        burns_alone = not self.growth and self.beta == 0.0 and self.p_regrow == 0.0
        return burns_alone and state.cells.device.type == "cpu" and not is_compiling()

    def flammability(self, cover: Tensor) -> Tensor:
        """Return alpha of the ground, float32, shape of ``cover`` (WARP-CA, terrain table)."""
        return look_up(tuple(self.alpha), cover)

    def slope_factor(self, elevation: Tensor, cell_size: float) -> Tensor:
        """Return the slope's factor of an episode, float32 [B, 8, H + 2, W + 1]; see ``kernel.slope_factor``."""
        return slope_factor(elevation, cell_size, self.slope_gain)

    def wind_factor(self, wind: Tensor) -> Tensor:
        """Return the wind's factor, float32 [B, 8, h, w], of a wind [B, 2, h, w] [m/s] at the burning cell."""
        if self.kernel == "ellipse":
            return ellipse(wind, self.head_gain)
        return alexandridis(wind, self.wind_gain, self.wind_focus)

    def in_wind(self, state: WorldState, wind: Tensor) -> WorldState:
        """Return worlds in another wind, float32 [B, 2, 1, 1] or [B, 2, H, W] [m/s], with all that follows from it."""
        gain = gains(self.wind_factor(wind), self.diagonal)
        if gain.shape[2:] != (1, 1):
            return state.replace(wind=wind, gain=None, chances=None)
        if state.slope is not None:
            return state.replace(wind=wind, gain=gain, chances=None)
        kinds = self._law().susceptibility(numbers(tuple(self.alpha), wind.device))
        return state.replace(wind=wind, gain=gain, chances=pattern_table(self._law(), kinds, gain, self.neighbours))

    def spread(self, state: WorldState) -> Tensor:
        """Return each tree's chance to be ignited by its neighbours in one tick, float32 [B, H, W]; 0 elsewhere."""
        spreading = self._spreading(state)
        if state.chances is not None and not is_compiling():  # a look-up costs more than what it spares there
            kind = (state.landscape.cover + 1) * byte(self.is_fuel(state))
            return chance_by_pattern(state.chances, spreading, kind)
        susceptible = self._susceptible(state)
        return ignition_chance(self._law(), spreading, susceptible, self._gain(state), state.slope, self.neighbours)

    def expected_ignitions(self, state: WorldState) -> Tensor:
        """Return how many neighbours each spreading cell is expected to ignite in one tick, float32 [B, H, W].

        It is 0 where nothing spreads.
        """
        susceptible, gain = self._susceptible(state), self._gain(state)
        expected = expected_ignitions(self._law(), susceptible, gain, state.slope, self.neighbours)
        return expected * number(self._spreading(state))

    def edge(self, state: WorldState) -> Edge:
        """Return the trees that a burning neighbour may ignite in the next tick."""
        return edge_of(self._spreading(state), self.is_fuel(state), self.neighbours)

    def outlook(self, state: WorldState) -> tuple[Tensor, Tensor]:
        """Return ``front`` and ``chance_to_ignite``, to the bit, by the fire's edge alone."""
        edge = self.edge(state)
        chances = self._chances_at(edge, state)
        return _as_front(expected_from_edge(edge, chances)), edge.on_map(chances.joined())

    def _chances_at(self, edge: Edge, state: WorldState) -> EdgeChances:
        """Return what tells the chances to ignite of the fire's edge, as ``spread`` does, to the bit."""
        if state.chances is not None:
            return ByPattern(edge, state.chances, edge.of(state.cover).to(torch.int64) + 1)
        law = self._law()
        return ByStrength(law, edge, law.susceptibility(edge.of(state.alpha)), self._gain(state), state.slope)

    def _spreading(self, state: WorldState) -> Tensor:
        return between(state.cells, FIRST_FIRE, self.last_spreading)

    def _gain(self, state: WorldState) -> Tensor:
        return gains(self.wind_factor(state.wind), self.diagonal) if state.gain is None else state.gain

    def _susceptible(self, state: WorldState) -> Tensor:
        return self._law().susceptibility(state.alpha) * number(self.is_fuel(state))

    def chance_to_ignite(self, state: WorldState) -> Tensor:
        """Return each tree's chance to ignite in the next tick, q = p_spont + (1 - p_spont) p_spread.

        float32 [B, H, W], 0 where nothing can ignite.
        """
        return self._join(state, self.spread(state))

    def front(self, state: WorldState) -> Tensor:
        """Return the neighbours that each cell is expected to ignite in a tick, / 4, at most 1, float32 [B, H, W]."""
        return _as_front(self.expected_ignitions(state))

    def _join(self, state: WorldState, spread: Tensor) -> Tensor:
        """Join the chance to be ignited by neighbours with that of spontaneous ignition."""
        if self.beta == 0.0:
            return spread
        chances = spontaneous_ignition(self.beta, state.cells[0].numel(), self.ticks_per_stage)
        spontaneous = look_up(chances, state.cells)
        spontaneous.mul_(number(self.is_fuel(state) & above(state.alpha, 0.0)))
        return (1.0 - spontaneous).mul_(spread).add_(spontaneous)

    def is_fuel(self, state: WorldState) -> Tensor:
        """Return which trees can ignite now: age >= A_min, dry; bool [B, H, W]."""
        return between(state.cells, self.youngest_fuel, OLDEST) & equal(state.wet, 0)

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
        cells = state.cells
        q = self.chance_to_ignite(state)
        grows = None
        if self.growth:
            leaves = look_up(growth(self.tau, self.ticks_per_stage), cells).mul_(1.0 - q)
            grows = ~below(u, torch.sub(1.0, leaves, out=leaves))  # u < 1: none grows where p is 0
        if self.p_regrow > 0.0:
            bare = equal(cells, 0) & holds_trees(state.landscape.cover) & ~as_mask(byte(state.firebreak))
            regrows = bare & below(u, in_a_tick(self.p_regrow, self.ticks_per_stage))
            grows = regrows if grows is None else grows | regrows
        state, due_cells = self._age_fires(state, due), byte(due)[:, None, None]
        ignite = byte(below(u, q)) * due_cells
        after = choose(ignite, FIRST_FIRE, state.cells)
        if grows is not None:
            after += byte(grows) * due_cells
        waited = None if state.stage_age is None else clear(ignite, state.stage_age)
        return state.replace(
            cells=narrow(after),
            age=narrow(choose(ignite, cells, state.age)),
            stage_age=waited if waited is None else narrow(waited),
        )

    def tick_at_edge(self, state: WorldState, edge: Edge, u: Tensor, due: Tensor) -> WorldState:
        """Return what ``tick`` does, to the bit, from the draws at the fire's edge alone, float32 [N]."""
        lit = edge.cell[(u < self._chances_at(edge, state).joined()) & due.index_select(0, edge.world)]
        after = self._age_fires(state, due)
        after.cells = put(after.cells, lit, FIRST_FIRE)
        after.age = put(after.age, lit, state.cells.flatten().index_select(0, lit))
        if after.stage_age is not None:
            after.stage_age = put(after.stage_age, lit, 0)
        return after

    def _age_fires(self, state: WorldState, due: Tensor) -> WorldState:
        """Return the worlds after a tick, where it is due, that ignites nothing and lets nothing grow.

        What it may yet ignite, ``cells``, ``age`` and ``stage_age``, is ``wide``.
        """
        cells, due_cells = wide(state.cells), byte(due)[:, None, None]
        stage_ends, waited = byte(is_burning(cells)) * due_cells, None
        if state.stage_age is not None:
            waited = wide(state.stage_age) + stage_ends
            stage_ends = byte(equal(waited, self.ticks_per_stage))
            waited = clear(stage_ends, waited)
        after = cells + stage_ends
        to_ash = byte(equal(after, EMBER + 1))
        return state.replace(
            cells=after.bitwise_and_(EMBER),
            age=clear(to_ash, state.age),
            stage_age=waited,
            burned=like(state.burned, byte(state.burned) | to_ash),
            wet=narrow(wide(state.wet) - byte(at_least(state.wet, 1)) * due_cells),
            tick=state.tick + due,
        )

    def _law(self) -> Law:
        return Clipped()


def _as_front(expected: Tensor) -> Tensor:
    """Return a quarter of what is expected, at most 1, in its own memory."""
    return expected.mul_(0.25).clamp_(max=1.0)
