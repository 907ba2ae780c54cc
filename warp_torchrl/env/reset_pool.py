"""Pool of resets: starts that lie ready on a device that is not read, several for each world.

On a CPU ``ResetCache`` asks at each step which worlds have ended. On a GPU each answer is a wait, so starts are taken
by masks, and the pool is filled once in many steps: one wait for all of them.
"""

import logging
from collections.abc import Callable, Sequence
from typing import TypeVar

import torch
from tensordict import TensorDict
from torch import Tensor

from warp_torchrl.env.reset_cache import Start
from warp_torchrl.world.arrays.batch import Batch

STEPS = 32
"""Steps between two fillings."""
READY = 4
"""Starts of each world after a filling: enough where its episodes last eight steps in the mean."""
log = logging.getLogger("warp_torchrl")
Batched = TypeVar("Batched", bound=Batch)


class ResetPool:
    """The starts of the next episodes of each world of a batch.

    A world whose starts have run out stays as it ended, with reward 0, until the next filling; so one wait is enough
    however short episodes are. Its episodes and what happens in them are those that they would be anywhere.

    Args:
        make: Returns the starts of seeds and episodes, int64 [n] each, and their faults, ``World.start``.
        check: Raises if faults, two of them, tell of any; they are of starts of the filling before.
        steps: Steps between two fillings.
        ready: Starts of each world after a filling.
    """

    def __init__(
        self,
        make: Callable[[Tensor, Tensor], tuple[Start, Tensor]],
        check: Callable[[Sequence[bool]], None],
        steps: int = STEPS,
        ready: int = READY,
    ) -> None:
        self._make, self._check, self._steps, self._ready = make, check, steps, ready
        self._starts: Start | None = None  # [ready x B]: episode e of world b at (e % ready) x B + b
        self._until: Tensor  # episodes up to which there are starts, int64 [B]; these three are set where starts begin
        self._waited: Tensor  # worlds that had none, int64 []
        self._faults: Tensor  # of the filling before, bool [2]
        self._since = 0

    def clear(self) -> None:
        """Drop all starts: the worlds get other seeds or episodes."""
        self._starts = None

    def take(self, ended: Tensor, now: Start, seeds: Tensor, episodes: Tensor) -> tuple[Start, Tensor]:
        """Return the worlds with those that have ended in their next episodes.

        Args:
            ended: Which worlds start, bool [B].
            now: The worlds as they are.
            seeds: Of all worlds, int64 [B].
            episodes: Numbers of their next episodes, int64 [B].

        Returns:
            The worlds, the counts of their trees and what is observed; entries that no start has are 0 where one
            began. And which worlds have started, bool [B]: all that ended, but those whose starts had run out.
        """
        known = self._starts
        if known is None or self._since >= self._steps:
            known = self.fill(seeds, episodes)
        self._since += 1
        starts = ended & (self._until > episodes)
        self._waited += (ended & ~starts).sum()
        row = episodes % self._ready * len(seeds) + torch.arange(len(seeds), device=seeds.device)
        worlds, counts, seen = now
        new_worlds, new_counts, new_seen = known
        taken = _chosen(starts, row, new_worlds, worlds), _chosen(starts, row, new_counts, counts)
        return (*taken, _seen(starts, row, new_seen, seen)), starts

    def fill(self, seeds: Tensor, episodes: Tensor) -> Start:
        """Make the starts that are missing, and return all; it reads from the device once which ones."""
        known = self._begin(seeds, episodes) if self._starts is None else self._starts
        told = torch.cat((self._until - episodes, self._faults.to(torch.int64), self._waited[None])).tolist()
        *ready, is_dark, is_crowded, waited = told
        self._check((is_dark, is_crowded))
        if waited:
            log.info("%d times an ended world waited for its next start: its episodes are very short", waited)
        for offset in range(self._ready):
            index = [world for world, count in enumerate(ready) if count <= offset]
            if index:
                some = torch.tensor(index).to(seeds.device, non_blocking=True)
                self._put(known, some, seeds[some], episodes[some] + offset)
        self._until = episodes + self._ready
        self._since, self._waited = 0, torch.zeros_like(self._waited)
        self._starts = known
        return known

    def _begin(self, seeds: Tensor, episodes: Tensor) -> Start:
        """Make room, and put one start of each world in all its places."""
        (worlds, counts, seen), self._faults = self._make(seeds, episodes)
        rows = torch.arange(len(seeds), device=seeds.device).repeat(self._ready)
        self._until, self._waited = episodes + 1, torch.zeros((), dtype=torch.int64, device=seeds.device)
        return worlds[rows], counts[rows], seen[rows]

    def _put(self, known: Start, index: Tensor, seeds: Tensor, episodes: Tensor) -> None:
        """Put the starts of some worlds, int64 [n], of these seeds and episodes in their places."""
        made, faults = self._make(seeds, episodes)
        place = episodes % self._ready * len(self._until) + index
        for all_of_them, new in zip(known, made, strict=True):
            all_of_them[place] = new
        self._faults = self._faults | faults


def _chosen(starts: Tensor, row: Tensor, new: Batched, old: Batched) -> Batched:
    found = new.leaves()
    return old.with_leaves(
        {
            name: torch.where(_beside(starts, leaf), found[name].index_select(0, row), leaf)
            for name, leaf in old.leaves().items()
        }
    )


def _seen(starts: Tensor, row: Tensor, new: TensorDict, old: TensorDict) -> TensorDict:
    out, found = old.copy(), dict(new.items(include_nested=True, leaves_only=True))
    for key, leaf in old.items(include_nested=True, leaves_only=True):
        other = found[key].index_select(0, row) if key in found else torch.zeros_like(leaf)
        out.set(key, torch.where(_beside(starts, leaf), other, leaf))
    return out


def _beside(mask: Tensor, leaf: Tensor) -> Tensor:
    return mask.view(-1, *[1] * (leaf.ndim - 1))
