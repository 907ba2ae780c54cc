"""Planes without what a world cannot fill: how entries are packed, and how the weights over whole ones are folded."""

from collections.abc import Mapping
from itertools import groupby
from typing import Any

import torch
from tensordict import TensorDictBase
from torch import Tensor

from warp_torchrl.entries import Follows, Quarters
from warp_torchrl.models.signature import Entry


class Packing:
    """How an entry [C, S, S] is packed into n numbers: all of the planes that may hold anything, then one number for
    each quarter of those that hold no more.

    Args:
        entry: What its planes can hold is told.

    Raises:
        ValueError: If a plane follows another one that is not read whole.
    """

    def __init__(self, entry: Entry) -> None:
        self.shape = entry.shape
        self.free = [place for place, each in enumerate(entry.content) if each is None]
        self.quarters = [place for place, each in enumerate(entry.content) if isinstance(each, Quarters)]
        self.follows = [(place, each) for place, each in enumerate(entry.content) if isinstance(each, Follows)]
        for place, each in self.follows:
            if each.of not in self.free:
                raise ValueError(f"plane {place} must follow one that can hold anything, got {each.of}")
        runs = [[place for _, place in run] for _, run in groupby(enumerate(self.free), lambda each: each[1] - each[0])]
        self._runs = [(run[0], run[-1] + 1) for run in runs]

    def is_whole(self, given: Tensor) -> bool:
        """Return whether an entry [..., C, S, S] is not packed yet, as [..., n] is."""
        return given.shape[-1] == self.shape[-1]

    def packed(self, given: Tensor) -> Tensor:
        """Return an entry [..., n], given packed or whole."""
        if not self.is_whole(given):
            return given
        half = self.shape[-1] // 2
        parts = [given[..., first:end, :, :].flatten(-3) for first, end in self._runs]
        parts += [given[..., place, ::half, ::half].flatten(-2) for place in self.quarters]
        return torch.cat(parts, dim=-1)

    def folded(self, weight: Tensor) -> tuple[Tensor, Tensor | None]:
        """Return the weights over a packed entry that are worth those over a whole one, and what they add to a bias.

        Args:
            weight: Over a whole entry, [out, C S S].

        Returns:
            Weights [out, n], and [out] in the entry's own numbers, None where nothing is added.
        """
        planes = list(weight.unflatten(1, self.shape).unbind(1))
        added = []
        for place, each in self.follows:
            planes[each.of] = planes[each.of] + each.factor * planes[place]
            added.append(each.offset * planes[place].sum((1, 2)))
        half = self.shape[-1] // 2
        parts = [torch.stack([planes[place] for place in self.free], dim=1).flatten(1)] if self.free else []
        parts += [
            planes[place].unflatten(2, (2, half)).unflatten(1, (2, half)).sum((2, 4)).flatten(1)
            for place in self.quarters
        ]
        return torch.cat(parts, dim=1), torch.stack(added).sum(0) if added else None


class Packings:
    """Packs entries of a batch.

    Args:
        entries: By key.
    """

    def __init__(self, entries: Mapping[Any, Entry]) -> None:
        found = {key: packing_of(entry) for key, entry in entries.items()}
        self._packings = {key: packing for key, packing in found.items() if packing is not None}

    def __call__(self, batch: TensorDictBase) -> TensorDictBase:
        """Return a batch with its entries packed, those that it has."""
        given = {key: (packing, batch.get(key, None)) for key, packing in self._packings.items()}
        packed = {key: packing.packed(value) for key, (packing, value) in given.items() if value is not None}
        return batch.copy().update(packed) if packed else batch


def packing_of(entry: Entry) -> Packing | None:
    """Return how an entry is packed; None where it is not, because every number of it may differ."""
    return Packing(entry) if any(each is not None for each in entry.content) else None


def own_dims(given: Tensor, entry: Entry) -> int:
    """Return how many of the dimensions of an entry, whole or packed, are not the batch's."""
    is_packed = bool(entry.content) and given.shape[-1] != entry.shape[-1]
    return 1 if is_packed else len(entry.shape)
