"""A tick and a forecast from the fire's edge alone: the road of a CPU where trees neither grow nor ignite alone."""

from torch import Tensor

from warp_torchrl.world.fast.bytes import index_put
from warp_torchrl.world.fast.edge import (
    ByPattern,
    ByStrength,
    Edge,
    EdgeProbabilities,
    edge_of,
    expected_from_edge,
)
from warp_torchrl.world.fast.join import in_place
from warp_torchrl.world.fast.planes import age_fires, is_fuel, spreads
from warp_torchrl.world.fire import Fire
from warp_torchrl.world.state import FIRST_FIRE, WorldState


def edge(fire: Fire, state: WorldState) -> Edge:
    """Return the trees that a burning neighbour may ignite in the next tick."""
    return edge_of(spreads(fire, state), is_fuel(fire, state), fire.directions)


def tick(fire: Fire, state: WorldState, trees: Edge, u: Tensor, due: Tensor) -> WorldState:
    """Return what ``Fire.tick`` does, from the draws at the fire's edge alone, float32 [N]."""
    lit = trees.cell[(u < probabilities(fire, state, trees).joined()) & due.index_select(0, trees.world)]
    after = age_fires(fire, state, due)
    after.cells = index_put(after.cells, lit, FIRST_FIRE)
    after.age = index_put(after.age, lit, state.cells.flatten().index_select(0, lit))
    if after.stage_age is not None:
        after.stage_age = index_put(after.stage_age, lit, 0)
    return after


def expected_and_probability(fire: Fire, state: WorldState) -> tuple[Tensor, Tensor]:
    """Return what ``Fire.expected_ignitions`` and ``Fire.ignition_probability`` do."""
    trees = edge(fire, state)
    each = probabilities(fire, state, trees)
    return expected_from_edge(trees, each), trees.on_map(each.joined())


def probabilities(fire: Fire, state: WorldState, trees: Edge) -> EdgeProbabilities:
    """Return what tells the probability to ignite of each tree of the edge."""
    if state.air.table is not None:
        return ByPattern(trees, state.air.table, trees.of(state.cover).long() + 1)
    law = in_place(fire.law)
    susceptible = law.susceptibility(trees.of(state.alpha))
    return ByStrength(law, trees, susceptible, fire.gain_in(state), state.ground.slope)
