"""What a type checker is told of tensorclasses, since tensordict tells it nothing of the classes that it makes."""

# ruff: noqa: D102  they are tensordict's methods

from dataclasses import field
from typing import TYPE_CHECKING, Any, Self, TypeVar, cast, dataclass_transform

import torch
from torch import Tensor

if TYPE_CHECKING:

    @dataclass_transform(field_specifiers=(field,))
    class _Dataclass: ...

    class Batch(_Dataclass):
        """What this package uses of a tensorclass, beside its own fields."""

        batch_size: torch.Size = field(kw_only=True)

        def __getitem__(self, index: Tensor | slice) -> Self: ...
        def __setitem__(self, index: Tensor, value: Self) -> None: ...
        def replace(self, **changes: Any) -> Self: ...
        def to(self, device: torch.device | str) -> Self: ...
        def clone(self) -> Self: ...
        def to_tensordict(self) -> Any: ...

else:
    Batch = object


Batched = TypeVar("Batched", bound=Batch)


def concatenated(parts: list[Batched]) -> Batched:
    """Return batches one after the other."""
    return cast(Batched, torch.cat(cast(Any, parts)))
