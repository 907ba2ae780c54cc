"""Imagined play: worlds that go on under a policy, for planners."""

from collections.abc import Callable

import torch
from torch import Tensor

from warp_torchrl.world.state.state import TreeCounts, WorldState
from warp_torchrl.world.world import World

_PART = 8
"""Imagined worlds go on without those that have ended when these are one in so many: to move the others takes time."""

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
    told: Tensor | None = None
    counts: TreeCounts | None = None
    for step in range(horizon):  # over time alone: all worlds that are imagined are one batch
        if step or action is None:
            action = choose(state, world.possible_actions(state))
        made = world.step(state, action, counts)
        state, counts = made.after, made.counts_after
        going = (~state.done).nonzero()[:, 0]
        is_last = step + 1 == horizon or not len(going)
        if is_last or len(going) * _PART < len(rows) * (_PART - 1):
            found = measure(state, counts)
            told = found if told is None else told.index_copy(0, rows, found)
            if is_last:
                break
            state, counts, rows = state[going], counts[going], rows[going]
    assert told is not None
    return told
