"""Terms r_i of the adaptive reward: a table from which a configuration chooses, and which users' modules extend.

@term("burnt_out")
def burnt_out(transition: Transition) -> Tensor:
    return (transition.counts_before.burned - transition.counts_after.burned) / transition.counts_before.initial
"""

from collections.abc import Callable

import torch
from torch import Tensor

from warp_torchrl.validation import check_new_name
from warp_torchrl.world.arrays.geometry import grow
from warp_torchrl.world.state.cells import is_burning, is_tree
from warp_torchrl.world.state.front import alignment, centre, sector
from warp_torchrl.world.state.state import Transition, TreeCounts, WorldState
from warp_torchrl.world.team.presence import those_there

Term = Callable[[Transition], Tensor]
"""What a step earns, float32 [B]: the difference of a state's value, or an event that can happen to a tree once."""
TERMS: dict[str, Term] = {}
"""All terms by name."""
_SECTORS = 8


def term(name: str) -> Callable[[Term], Term]:
    """Return a decorator that adds a term to the table under a name.

    Raises:
        ValueError: If the table has another term of that name.
    """

    def add(made: Term) -> Term:
        check_new_name("term", name, made, TERMS.get(name))
        TERMS[name] = made
        return made

    return add


@term("front")
def front(transition: Transition) -> Tensor:
    """Return the drop in the burning cells that touch trees that can burn, a share of N0, float32 [B]."""
    before = _front(transition.before, transition.counts_before)
    return before - _front(transition.after, transition.counts_after)


@term("surrounded")
def surrounded(transition: Transition) -> Tensor:
    """Return the rise in the share of eight sectors about the fire's centre that have an agent, float32 [B].

    Where nothing burns it is 1.
    """
    return _surrounded(transition.after) - _surrounded(transition.before)


@term("head")
def head(transition: Transition) -> Tensor:
    """Return the rise in the share of agents on the downwind half of the fire, float32 [B]; 1 where nothing burns."""
    return _at_head(transition.after) - _at_head(transition.before)


def _front(state: WorldState, counts: TreeCounts) -> Tensor:
    fuel = is_tree(state.cells) & (state.alpha > 0.0)
    return (is_burning(state.cells) & grow(fuel, 1)).sum((1, 2)) / counts.initial


def _surrounded(state: WorldState) -> Tensor:
    fire = is_burning(state.cells)
    own = sector(state.vehicles.position, centre(fire), _SECTORS)
    there = those_there(state, torch.ones_like(own, dtype=torch.bool)).to(torch.float32)
    held = torch.zeros(len(own), _SECTORS, device=own.device).scatter_reduce(1, own, there, "amax")
    return held.mean(dim=1).masked_fill(~fire.flatten(1).any(dim=1), 1.0)


def _at_head(state: WorldState) -> Tensor:
    fire = is_burning(state.cells)
    downwind = those_there(state, alignment(state.vehicles.position, centre(fire), state.wind) >= 0.0)
    return downwind.to(torch.float32).mean(dim=1).masked_fill(~fire.flatten(1).any(dim=1), 1.0)
