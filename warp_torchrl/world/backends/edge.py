"""The fire's edge, the trees that a burning neighbour may ignite in the next tick: the backend of a CPU.

Where trees neither grow nor ignite by themselves, nothing else is drawn for. They are a few cells in a hundred, so that
probabilities and draws at them alone cost a fraction of those of whole maps, and come to the same bits. How many they
are is read back, which a CPU does for nothing and a CUDA device does not.
"""

from dataclasses import dataclass
from functools import cached_property
from typing import Protocol

import torch
from torch import Tensor

from warp_torchrl.system.modes import kept
from warp_torchrl.world.arrays.bytes import byte, index_put
from warp_torchrl.world.arrays.geometry import DIRECTIONS
from warp_torchrl.world.arrays.listing import places
from warp_torchrl.world.arrays.random import Stream, uniform_among
from warp_torchrl.world.backends.join import Joining, in_place
from warp_torchrl.world.backends.planes import age_fires, is_fuel, spreads
from warp_torchrl.world.backends.table import BESIDE, bits, burning_neighbours, table_in
from warp_torchrl.world.law.fire import Fire, slope_in
from warp_torchrl.world.state.state import FIRST_FIRE, WorldState


class AtEdge:
    """Ticks and forecasts from the fire's edge alone.

    Args:
        fire: The automaton.
    """

    def __init__(self, fire: Fire) -> None:
        self.fire = fire

    def tick(self, state: WorldState, ticks_now: Tensor) -> WorldState:
        """Return the worlds after one tick of the fire with their own draws, in the worlds that tick now, bool [B]."""
        trees = self.edge(state)
        u = uniform_among(state.key, state.tick, Stream.FIRE, trees.world, trees.place)
        ignites = (u < self._probabilities(state, trees).joined()) & ticks_now.index_select(0, trees.world)
        lit = trees.cell[ignites]
        after = age_fires(self.fire, state, ticks_now)
        after.cells = index_put(after.cells, lit, FIRST_FIRE)
        after.age = index_put(after.age, lit, state.cells.flatten().index_select(0, lit))
        if after.stage_age is not None:
            after.stage_age = index_put(after.stage_age, lit, 0)
        return after

    def forecast(self, state: WorldState) -> tuple[Tensor, Tensor]:
        """Return what ``Fire.expected_ignitions`` and ``Fire.ignition_probability`` do, float32 [B, H, W] each."""
        trees = self.edge(state)
        each = self._probabilities(state, trees)
        return expected_from_edge(trees, each), trees.on_map(each.joined())

    def edge(self, state: WorldState) -> "Edge":
        """Return the trees that a burning neighbour may ignite in the next tick."""
        return edge_of(spreads(self.fire, state), is_fuel(self.fire, state), self.fire.directions)

    def _probabilities(self, state: WorldState, trees: "Edge") -> "EdgeProbabilities":
        table = table_in(state)
        if table is not None:
            return ByPattern(trees, table, trees.of(state.cover).long() + 1)
        law = in_place(self.fire.law)
        susceptible = law.susceptibility(trees.of(state.alpha))
        return ByStrength(law, trees, susceptible, self.fire.gain_in(state), slope_in(state))


@dataclass(frozen=True, eq=False)
class Edge:
    """Trees next to burning cells, world after world and row after row."""

    shape: torch.Size
    """(B, H, W)."""
    directions: range
    """Those in which fire travels."""
    cell: Tensor
    """Flat index of each in [B, H, W], int64 [N]."""
    pattern: Tensor
    """Of ``table.burning_neighbours``, int64 [N]."""

    @cached_property
    def world(self) -> Tensor:
        """Return the world that each lies in, int64 [N]."""
        return self.cell.div(self.shape[1] * self.shape[2], rounding_mode="floor")

    @cached_property
    def place(self) -> Tensor:
        """Return the flat index of each within its world, int64 [N]."""
        return self.cell - self.world * (self.shape[1] * self.shape[2])

    def of(self, plane: Tensor) -> Tensor:
        """Return what a plane [B, H, W] holds there, [N]."""
        return plane.flatten().index_select(0, self.cell)

    @cached_property
    def source(self) -> Tensor:
        """Return the flat index of the neighbour that fire in each direction comes from, int64 [D, N].

        There is one only where ``burns`` says so.
        """
        return self.cell - _offsets(self.directions, self.shape[2], self.cell.device)

    @cached_property
    def burns(self) -> Tensor:
        """Return 1.0 where the neighbour that fire in each direction comes from burns, else 0.0, float32 [D, N]."""
        return (self.pattern >> bits(self.directions, self.cell.device)).bitwise_and_(1).to(torch.float32)

    def on_map(self, values: Tensor) -> Tensor:
        """Return maps [B, H, W] that hold these values there, [N], and 0 elsewhere."""
        return values.new_zeros(self.shape.numel()).scatter_(0, self.cell, values).view(self.shape)


@kept(32)
def _offsets(directions: range, width: int, device: torch.device) -> Tensor:
    """Return how far before a cell the neighbour lies that fire in each direction comes from, int64 [D, 1]."""
    ways = [DIRECTIONS[direction] for direction in directions]
    return torch.tensor([[row * width + column] for row, column in ways], device=device)


def edge_of(spreading: Tensor, fuel: Tensor, directions: range) -> Edge:
    """Return the fire's edge.

    Args:
        spreading: The burning cells that ignite others, bool [B, H, W].
        fuel: The trees that can ignite, bool [B, H, W].
        directions: Those in which fire travels.
    """
    around = burning_neighbours(spreading)
    if len(directions) == 4:
        around &= BESIDE
    cell = places((around * byte(fuel)).flatten())
    return Edge(spreading.shape, directions, cell, around.flatten().index_select(0, cell).to(torch.int64))


class EdgeProbabilities(Protocol):
    """Probabilities of the trees of an edge to ignite in one tick."""

    def joined(self) -> Tensor:
        """Return the probability that the burning neighbours together ignite the tree, float32 [N]."""
        ...

    def alone(self) -> Tensor:
        """Return the probability that the neighbour upstream of each direction ignites the tree, float32 [D, N].

        It is as if that neighbour burned, and undefined where it is off the map.
        """
        ...


class ByPattern:
    """Probabilities in level worlds with one wind each.

    Args:
        edge: The trees.
        table: Of ``table.pattern_table``, float32 [B, G + 1, 256].
        kind: Row of the table, int64 [N].
    """

    def __init__(self, edge: Edge, table: Tensor, kind: Tensor) -> None:
        _, kinds, patterns = table.shape
        self._edge, self._table = edge, table.flatten()
        self._row = (edge.world * kinds).add_(kind).mul_(patterns)

    def joined(self) -> Tensor:
        """See ``EdgeProbabilities``."""
        return self._table.index_select(0, self._row + self._edge.pattern)

    def alone(self) -> Tensor:
        """See ``EdgeProbabilities``."""
        index = self._row + (1 << bits(self._edge.directions, self._row.device))
        return self._table.index_select(0, index.flatten()).view(index.shape)


class ByStrength:
    """Probabilities in any worlds.

    Args:
        law: How strengths make a probability.
        edge: The trees.
        susceptible: The ground's part of a strength, float32 [N].
        gain: As of ``rows.probability_from_rows``, and so is the slope.
        slope: float32 [B, 8, H + 2, W + 1] or None.
    """

    def __init__(self, law: Joining, edge: Edge, susceptible: Tensor, gain: Tensor, slope: Tensor | None) -> None:
        self._law, self._edge, self._susceptible, self._gain, self._slope = law, edge, susceptible, gain, slope

    def joined(self) -> Tensor:
        """See ``EdgeProbabilities``."""
        total = torch.zeros_like(self._susceptible)
        spare = torch.empty_like(total)
        for place in range(len(self._edge.directions)):
            self._law.join(total, self._strength(place).mul_(self._edge.burns[place]), spare)
        return self._law.probability(total)

    def alone(self) -> Tensor:
        """See ``EdgeProbabilities``."""
        directions = range(len(self._edge.directions))
        return torch.stack([self._law.probability_of(self._strength(place)) for place in directions])

    def _strength(self, place: int) -> Tensor:
        """Return the strength in the direction at a place among the edge's, float32 [N]."""
        edge, direction = self._edge, self._edge.directions[place]
        gain, differs = self._gain[:, direction].flatten(), self._gain.shape[2:] != (1, 1)
        source = edge.source[place].clamp(0, len(gain) - 1) if differs else edge.world
        strength = gain.index_select(0, source).mul_(self._susceptible)
        if self._slope is not None:
            strength.mul_(self._slope[:, direction].flatten().index_select(0, self._target))
        return strength

    @cached_property
    def _target(self) -> Tensor:
        """Return where each tree stands in a direction's slopes: they have a row before the map, a column after it."""
        _, height, width = self._edge.shape
        place = self._edge.place
        row = place.div(width, rounding_mode="floor")
        return self._edge.world * ((height + 2) * (width + 1)) + (row + 1) * (width + 1) + (place - row * width)


def expected_from_edge(edge: Edge, probabilities: EdgeProbabilities) -> Tensor:
    """Return how many neighbours each burning cell is expected to ignite in one tick, float32 [B, H, W]; 0 elsewhere.

    Args:
        edge: The trees.
        probabilities: Of those trees.
    """
    margin = edge.shape[2] + 1  # where no neighbour burns 0 is added, maybe beside the batch
    total = torch.zeros(edge.shape.numel() + 2 * margin, device=edge.cell.device)
    total.scatter_add_(0, (edge.source + margin).flatten(), (edge.burns * probabilities.alone()).flatten())
    return total[margin:-margin].view(edge.shape)
