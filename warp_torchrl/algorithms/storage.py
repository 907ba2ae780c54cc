"""Storage of batches and replayed transitions: TorchRL's, with whole-row copies."""

from collections.abc import Sequence
from typing import Any

import torch
from tensordict import TensorDict, TensorDictBase, is_tensor_collection
from torch import Tensor
from torchrl.data import LazyTensorStorage


class RowStorage(LazyTensorStorage):
    """TorchRL's storage with copies of whole rows.

    Indexing by a tensor copies element by element, which for uint8 observations takes several times as long as a slice
    or ``index_select``.
    """

    def set(self, cursor: int | Sequence[int] | slice | Tensor, data: Any, *, set_cursor: bool = True) -> None:
        """Put transitions at ``cursor``."""
        if isinstance(cursor, Tensor) and cursor.is_cpu and cursor.ndim == 1 and len(cursor):
            first = int(cursor[0])
            if torch.equal(cursor, torch.arange(len(cursor)) + first):
                cursor = slice(first, first + len(cursor))
        super().set(cursor, data, set_cursor=set_cursor)

    def get(self, index: int | Sequence[int] | slice | Tensor) -> Any:
        """Return the transitions at ``index``, in a tensor int64 [n] where there are several of no order."""
        if self.initialized and isinstance(index, Tensor) and index.dtype == torch.int64 and index.ndim == 1:
            return _rows(self._storage, index if self._storage.device is None else index.to(self._storage.device))
        return super().get(index)


class BatchStorage(RowStorage):
    """Storage of one batch: each ``set`` puts rows from the first on, in order, and leaves the cursor unread."""

    def set(self, cursor: int | Sequence[int] | slice | Tensor, data: Any, *, set_cursor: bool = True) -> None:
        """Put a batch in the place of the former one."""
        super().set(slice(0, len(data)), data, set_cursor=set_cursor)


def _rows(data: TensorDictBase, index: Tensor) -> TensorDict:
    """Return the rows [n, ...] of a tensordict [N, ...]."""
    found = {
        name: _rows(each, index) if is_tensor_collection(each) else each.index_select(0, index)
        for name, each in data.items()
    }
    return TensorDict(found, batch_size=[len(index), *data.batch_size[1:]], device=data.device)
