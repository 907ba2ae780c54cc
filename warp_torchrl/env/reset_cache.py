"""Cache of resets: the next episode of every world is prepared in one batch.

The start of an episode is a pure function of a world's seed and episode number. A few worlds end at almost every step,
and a start costs nearly the same for one world as for many.
"""

from collections.abc import Callable

import torch
from tensordict import TensorDict
from torch import Tensor

from warp_torchrl.world.state.state import TreeCounts, WorldState

Start = tuple[WorldState, TreeCounts, TensorDict]
"""Worlds at the start of an episode, the counts of their trees, and what is observed there."""


class ResetCache:
    """The start of the next episode of each world of a batch.

    Args:
        make: Returns the starts of seeds and episodes, int64 [n] each.
    """

    def __init__(self, make: Callable[[Tensor, Tensor], Start]) -> None:
        self._make = make
        self._next: Start | None = None
        self._made: Tensor  # which worlds have their start, bool [B]; set with the first

    def clear(self) -> None:
        """Drop all starts: the worlds get other seeds or episodes."""
        self._next = None

    def pop(self, index: Tensor, seeds: Tensor, episodes: Tensor) -> Start:
        """Return the starts of some worlds; where one is missing, all that are missing are made.

        Args:
            index: Which worlds start, int64 [n].
            seeds: Of all worlds, int64 [B].
            episodes: Numbers of their next episodes, int64 [B].

        Returns:
            The worlds, the counts of their trees and what is observed, [n] each.
        """
        if self._next is None:
            self._next = self._make(seeds, episodes)
            self._made = torch.ones_like(seeds, dtype=torch.bool)
        elif not self._made[index].all():
            missing = (~self._made).nonzero()[:, 0]
            for known, made in zip(self._next, self._make(seeds[missing], episodes[missing]), strict=True):
                known[missing] = made
            self._made[missing] = True
        self._made[index] = False
        worlds, counts, seen = self._next
        return worlds[index], counts[index], seen[index]
