"""Imagined play: worlds continued under a policy, for planners."""

from collections.abc import Callable

import torch
from torch import Tensor

from warp_torchrl.world.state.cells import count_trees
from warp_torchrl.world.state.state import TreeCounts, WorldState
from warp_torchrl.world.world import World

CELLS = 2**21
"""Largest number of cells of the worlds in one batch; it bounds the memory."""
_PART = 8
"""Imagined worlds continue without those that have ended when these are one in eight: to move the others takes time."""

Choice = Callable[[WorldState, Tensor], Tensor]
"""Returns actions, int64 [n, A], of worlds and the actions that do something, bool [n, A, actions]."""
Measure = Callable[[WorldState, TreeCounts], Tensor]
"""Returns a number of each world, [n]."""


def trees_saved(_: WorldState, counts: TreeCounts) -> Tensor:
    """Return the trees that stand, int32 [n]."""
    return counts.preserved + counts.extinguished


def played(
    world: World, state: WorldState, choose: Choice, horizon: int, measure: Measure, action: Tensor | None = None
) -> Tensor:
    """Return what is measured of worlds after some steps, or where they end before, [n].

    Args:
        world: Their rules.
        state: The worlds at the start.
        choose: The policy.
        horizon: Steps, at least 1.
        measure: What is measured.
        action: Of the first step, int64 [n, A]; None: the policy chooses it too.
    """
    rows = torch.arange(len(state.key), device=state.key.device)
    counts, told = count_trees(state), []
    for step in range(horizon):  # over time alone: all worlds that are imagined are one batch
        if step or action is None:
            action = choose(state, world.possible_actions(state))
        made = world.step(state, action, counts)
        state, counts = made.after, made.counts_after
        going = (~state.done).nonzero()[:, 0]
        if not len(going):
            break
        if len(going) * _PART < len(rows) * (_PART - 1):
            ended = state.done.nonzero()[:, 0]
            told.append((rows[ended], measure(state[ended], counts[ended])))
            state, counts, rows = state[going], counts[going], rows[going]
    told.append((rows, measure(state, counts)))
    order, values = (torch.cat(each) for each in zip(*told, strict=True))
    return values[order.argsort()]


def at_once(state: WorldState, cells: int) -> int:
    """Return the number of worlds that are imagined in one batch of at most ``cells`` cells, at least 1."""
    return max(1, cells // state.cells[0].numel())
