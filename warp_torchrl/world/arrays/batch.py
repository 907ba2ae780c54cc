"""Batches: dataclasses of tensors whose first dimension is the worlds'.

They are plain objects. A step makes a dozen of them and reads some hundreds of their fields, which as entries of
tensordicts took a quarter of the time of a step of one world.
"""

from collections.abc import Callable, ItemsView
from dataclasses import dataclass, field
from typing import Any, Self, TypeVar

import torch
from torch import Tensor


@dataclass(eq=False, repr=False)
class Batch:
    """What dataclasses of tensors [B, ...] have in common; a field may be another batch, a number or None too."""

    @property
    def batch_size(self) -> torch.Size:
        """Return (B,)."""
        return next(iter(self.leaves().values())).shape[:1]

    def __repr__(self) -> str:
        """Return the shapes and types of the tensors."""
        kinds = [f"{name}: {str(leaf.dtype)[6:]} {list(leaf.shape)}" for name, leaf in self.leaves().items()]
        return f"{type(self).__name__}({', '.join(kinds)})"

    def replace(self, **changes: Any) -> Self:
        """Return the same batch but for some fields; what is not replaced is shared."""
        return type(self)(**(vars(self) | changes))  # half of what ``dataclasses.replace`` takes

    def clone(self) -> Self:
        """Return a copy that shares no memory."""
        return self._each(Tensor.clone)

    def to(self, device: torch.device | str) -> Self:
        """Return the batch on a device."""
        return self._each(lambda leaf: leaf.to(device))

    def __getitem__(self, index: Tensor | slice) -> Self:
        """Return some worlds: those of a slice, of a mask bool [B], or of indices from 0 on, int64 [n]."""
        if isinstance(index, Tensor) and index.dtype == torch.int64:
            return self._each(lambda leaf: leaf.index_select(0, index))  # several times faster than others
        return self._each(lambda leaf: leaf[index])

    def __setitem__(self, index: Tensor, value: Self) -> None:
        """Put other worlds in the places of some, indices int64 [n]."""
        given = value.leaves()
        for name, leaf in self.leaves().items():
            leaf.index_copy_(0, index, given[name])

    def parts(self) -> ItemsView[str, Any]:
        """Return the names and values of what it holds: tensors, batches, numbers, None."""
        return vars(self).items()

    def leaves(self) -> dict[str, Tensor]:
        """Return all tensors by name; those of a batch in it have names like ``vehicles.position``."""
        found: dict[str, Tensor] = {}
        for name, value in self.parts():
            if isinstance(value, Batch):
                found.update({f"{name}.{inner}": leaf for inner, leaf in value.leaves().items()})
            elif isinstance(value, Tensor):
                found[name] = value
        return found

    def with_leaves(self, leaves: dict[str, Tensor], prefix: str = "") -> Self:
        """Return a batch like this one of other tensors, which have the names of ``leaves`` after the prefix."""
        changes: dict[str, Any] = {}
        for name, value in self.parts():
            if isinstance(value, Batch):
                changes[name] = value.with_leaves(leaves, f"{prefix}{name}.")
            elif isinstance(value, Tensor):
                changes[name] = leaves[prefix + name]
        return self.replace(**changes)

    def _each(self, change: Callable[[Tensor], Tensor]) -> Self:
        return self.with_leaves({name: change(leaf) for name, leaf in self.leaves().items()})


@dataclass(eq=False, repr=False)
class Named(Batch):
    """Tensors and batches whose names their reader gives."""

    held: dict[str, Any] = field(default_factory=dict)  # tensors [B, ...] and batches

    def parts(self) -> ItemsView[str, Any]:
        """Return the names and values of what it holds."""
        return self.held.items()

    def replace(self, **changes: Any) -> Self:
        """Return the same batch but for some of what it holds."""
        return type(self)({**self.held, **changes})


Batched = TypeVar("Batched", bound=Batch)


def concatenated(parts: list[Batched]) -> Batched:
    """Return batches one after the other."""
    leaves = [part.leaves() for part in parts]
    return parts[0].with_leaves({name: torch.cat([each[name] for each in leaves]) for name in leaves[0]})
