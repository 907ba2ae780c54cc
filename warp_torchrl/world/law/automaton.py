"""What every law of fire has in common: an automaton with trees that age, stages of fire, and a wind."""

from abc import ABC, abstractmethod
from collections.abc import Callable
from dataclasses import dataclass
from functools import lru_cache
from typing import NamedTuple, Self

import torch
from torch import Tensor

from warp_torchrl.validation import check_fields
from warp_torchrl.world.air.wind import Wind
from warp_torchrl.world.arrays.constants import numbers
from warp_torchrl.world.arrays.geometry import DIRECTIONS
from warp_torchrl.world.arrays.random import Stream, uniform
from warp_torchrl.world.law import law
from warp_torchrl.world.law.cells import holds_trees
from warp_torchrl.world.state.state import EMBER, FIRST_FIRE, OLDEST, Air, Ground, Landscape, WorldState
from warp_torchrl.world.terrain.source import LandscapeSource


class Beside(NamedTuple):
    """Some trees of B worlds, n each, and what may spread fire beside them."""

    cell: Tensor  # int64 [B,n], flat index
    spreads: Tensor  # float32 [B,8,n], chance that there is a source of fire that travels in each direction

    def source(self, direction: int, width: int, cells: int) -> Tensor:
        """Return the flat index of the source in a direction, int64 [B, n]; any cell where it is off the map."""
        row, column = DIRECTIONS[direction]
        return (self.cell - row * width - column).clamp(0, cells - 1)

    def of(self, planes: Tensor) -> Tensor:
        """Return what planes [B, ..., H, W] hold at the trees, [B, ..., n]."""
        return at_cells(planes, self.cell)


def at_cells(planes: Tensor, cell: Tensor) -> Tensor:
    """Return what planes [B, ..., H, W] hold at cells int64 [B, n], [B, ..., n]."""
    flat = planes.flatten(-2)
    shape = (len(cell), *flat.shape[1:-1], cell.shape[1])
    index = cell.view(len(cell), *[1] * (flat.ndim - 2), -1).expand(shape)
    return flat.gather(-1, index)


@dataclass(frozen=True, kw_only=True)
class Automaton(ABC):
    """An automaton: trees that ignite, grow and regrow, and fires that burn out.

    Attributes:
        growth: Whether trees age, age + 1 with p = exp(-age / S_max tau).
        tau: Growth constant.
        beta: Spontaneous ignition, p = beta exp(10 age / S_max) / exp(10) / (H W) for each tree.
        p_regrow: Chance a tick that empty ground grows a tree of age 1.
        youngest_fuel: A_min, the age from which a tree can ignite.
        oldest: S_max, the age of the oldest trees, at most the 10 that cell codes hold. Landscapes tell ages in tenths
            of it; where it is not 10, a tree's age is drawn within its tenth.
        burning_stages: Stages that spread, of five. The others are embers: seen, burning, and without spread.

    Raises:
        ValueError: If a value is out of its range.
    """

    growth: bool = False
    tau: float = 5.0
    beta: float = 0.0
    p_regrow: float = 0.0
    youngest_fuel: int = 2
    oldest: int = OLDEST
    burning_stages: int = 4

    def __post_init__(self) -> None:
        check_fields(
            self,
            tau=(0.0, 100.0),
            beta=(0.0, 1e6),
            p_regrow=(0.0, 1.0),
            youngest_fuel=(1, OLDEST),
            oldest=(1, OLDEST),
            burning_stages=(1, EMBER - FIRST_FIRE + 1),
        )
        if self.youngest_fuel > self.oldest:
            raise ValueError(f"youngest_fuel must be at most oldest, {self.oldest}, got {self.youngest_fuel}")

    @property
    def ticks_per_stage(self) -> int:
        """Return the ticks that a burning stage lasts, and that make one of the paper's."""
        return 1

    @property
    def minutes(self) -> float | None:
        """Return the minutes of a tick; None where it has none."""
        return None

    @property
    def last_spreading(self) -> int:
        """Return the cell code of the last stage that spreads and can be put out."""
        return FIRST_FIRE + self.burning_stages - 1

    @property
    @abstractmethod
    def wet_for(self) -> int:
        """Return the ticks for which a tree that was put out cannot ignite."""

    @property
    def burns_out(self) -> bool:
        """Return whether a world without fire stays so: an episode may end early."""
        return self.beta == 0.0

    @property
    def keeps(self) -> tuple[str, ...]:
        """Return the names of the planes that the automaton keeps in ``WorldState.extras``."""
        return ()

    @property
    def draws(self) -> tuple[str, ...]:
        """Return the names of those tensors of a state that are drawn with the ground, see ``drawn_again``."""
        return ()

    def drawn_again(self, ground: Ground, key: Tensor) -> Ground:
        """Return ground in which what the law draws of it is drawn of other keys, int64 [B]."""
        return ground

    def at_rate(self, ground: Ground, factor: Tensor) -> Ground:
        """Return ground on which fire spreads at other rates, by a factor for each world, float32 [B].

        Here flammability has the factor, and is 1 at most.
        """
        return ground.replace(alpha=self.faster(ground.alpha, factor[:, None, None]))

    def faster(self, alpha: Tensor, factor: Tensor) -> Tensor:
        """Return the flammability of ground on which fire spreads at another rate, float32 of their common shape."""
        return (alpha * factor).clamp(max=1.0)

    def ignition_beside(self, state: WorldState, beside: Beside, rate: Tensor, air: Air) -> Tensor:
        """Return how likely trees ignite in a tick at P rates in P winds, float32 [B, P, n].

        Args:
            state: The worlds, of which the ground is read.
            beside: The trees, and how likely each neighbour spreads fire.
            rate: Factors on the rate of spread, float32 [B, P].
            air: P winds of each world, batch size [B * P].
        """
        raise TypeError(f"{type(self).__name__} does not say how likely trees ignite: define ignition_beside()")

    def started(self, state: WorldState) -> WorldState:
        """Return worlds at their start, whose cells are lit, with the planes of the automaton."""
        return state

    def lit(self, state: WorldState, where: Tensor) -> WorldState:
        """Return worlds in which cells, bool [B, H, W], were set alight now, with what the automaton keeps of them."""
        return state

    def aged(self, landscape: Landscape, key: Tensor) -> Landscape:
        """Return landscapes whose trees have the ages of this automaton, in 0..S_max.

        A tree of tenth a is round(S_max x) old, x drawn from where round(10 x) = a; so drawn forests are
        round(S_max U(0, 1)), and those that come to 0 hold no tree.

        Args:
            landscape: The landscapes, with ages in tenths.
            key: World keys, int64 [B].
        """
        if self.oldest == OLDEST:
            return landscape
        tenth = landscape.age.to(torch.float32)
        u = uniform(key, 0, Stream.AGE_IN_TENTH, tuple(landscape.age.shape[1:]))
        low, high = (tenth - 0.5).clamp(min=0.0), (tenth + 0.5).clamp(max=float(OLDEST))
        age = (low + u * (high - low)).mul_(self.oldest / OLDEST).round_().to(torch.int32).to(torch.uint8)
        return landscape.replace(age=age * holds_trees(landscape.cover))

    def over(self, landscape: LandscapeSource, wind: Wind, cell_size: float) -> Self:
        """Return the automaton on a landscape's map in some wind; a cell's side is in metres."""
        return self

    @abstractmethod
    def ground(self, landscape: Landscape, cell_size: float, key: Tensor) -> Ground:
        """Return landscapes with all that follows from them for the fire.

        Args:
            landscape: The landscapes.
            cell_size: Side of a cell [m].
            key: World keys, int64 [B].
        """

    @abstractmethod
    def flammability(self, landscape: Landscape) -> Tensor:
        """Return how well the ground burns, float32 [B, H, W] in 0..1; 0 where it cannot."""

    @abstractmethod
    def air(self, wind: Tensor, moisture: Tensor | None, ground: Ground) -> Air:
        """Return a wind with all that follows from it for the fire on some ground.

        Args:
            wind: float32 [B, 2, 1, 1] or [B, 2, H, W] [m/s].
            moisture: Of ``Wind.moisture``, or None.
            ground: The ground.
        """

    def in_air(self, state: WorldState, air: Air) -> WorldState:
        """Return worlds in another air."""
        return state.replace(air=air)

    @abstractmethod
    def ignition_probability(self, state: WorldState) -> Tensor:
        """Return each tree's probability to ignite in the next tick, float32 [B, H, W]; 0 where nothing can."""

    @abstractmethod
    def expected_ignitions(self, state: WorldState) -> Tensor:
        """Return how many neighbours each burning cell is expected to ignite in one tick, float32 [B, H, W]; else 0."""

    def spreads(self, state: WorldState) -> Tensor:
        """Return which cells burn and ignite others, bool [B, H, W]."""
        return (state.cells >= FIRST_FIRE) & (state.cells <= self.last_spreading)

    def is_fuel(self, state: WorldState) -> Tensor:
        """Return which trees can ignite now: age >= A_min, dry; bool [B, H, W]."""
        return (state.cells >= self.youngest_fuel) & (state.cells <= OLDEST) & (state.wet == 0)

    def can_ignite(self, state: WorldState) -> Tensor:
        """Return which trees can ignite now and stand on ground that burns, bool [B, H, W]."""
        return self.is_fuel(state) & (state.alpha > 0.0)

    def tick(self, state: WorldState, u: Tensor, ticks_now: Tensor) -> WorldState:
        """Advance the fire by one tick in the worlds that tick now.

        Args:
            state: The worlds before the tick.
            u: Uniform draws in [0, 1), float32 [B, H, W].
            ticks_now: Which worlds tick, bool [B].

        Returns:
            The worlds after it, with new ``cells``, ``age``, ``stage_age``, ``burned``, ``wet`` and ``tick``.
        """
        return self.tick_with(state, u, ticks_now, self.ignition_probability(state))

    def tick_with(self, state: WorldState, u: Tensor, ticks_now: Tensor, q: Tensor) -> WorldState:
        """Advance as ``tick`` does, with these probabilities to ignite, float32 [B, H, W]."""
        fertile = (state.cells == 0) & holds_trees(state.cover) & (state.firebreak == 0)
        return law.tick(
            state,
            u,
            ticks_now,
            q=q,
            grow=of_codes(self.growing(), state.cells),
            regrow=fertile * law.in_finer_time(self.p_regrow, self.ticks_per_stage),
            stage=self.ticks_per_stage,
        )

    def spontaneous(self, state: WorldState) -> Tensor:
        """Return each tree's probability to ignite by itself in the next tick, float32 [B, H, W]."""
        return of_codes(self.lightning(state.cells[0].numel()), state.cells) * self.can_ignite(state)

    def growing(self) -> tuple[float, ...]:
        """Return p_grow in one tick of each cell code, 0..15."""
        return _by_code(law.growth_probability, (self.tau, self.oldest), self.ticks_per_stage) if self.growth else _NONE

    def lightning(self, cells: int) -> tuple[float, ...]:
        """Return p_spont in one tick of each cell code, 0..15, on a map of so many cells."""
        return _by_code(law.lightning_probability, (self.beta, cells, self.oldest), self.ticks_per_stage)


_NONE = (0.0,) * (EMBER + 1)


@lru_cache(64)
def _by_code(rule: Callable[..., float], given: tuple[float, ...], ticks: int) -> tuple[float, ...]:
    """Return a rule's probability in each of so many ticks, of each cell code; kept for the next time."""
    return tuple(law.in_finer_time(rule(code, *given), ticks) for code in range(EMBER + 1))


def of_codes(table: tuple[float, ...], codes: Tensor) -> Tensor:
    """Return what a table holds for each code, float32, shape of the codes."""
    values = numbers(table, codes.device)
    return values.index_select(0, codes.flatten().to(torch.int32)).view(codes.shape)
