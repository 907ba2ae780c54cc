"""Where batches and replayed transitions are held: TorchRL's storage, from which samples are taken a row at a time."""

from collections.abc import Sequence
from typing import Any

import torch
from tensordict import TensorDict, TensorDictBase, is_tensor_collection
from torch import Tensor
from torchrl.data import LazyTensorStorage


class RowStorage(LazyTensorStorage):
    """TorchRL's storage, which gives a sample's transitions as ``index_select`` does.

    Indexed by a tensor, torch copies number by number, which for observations in bytes takes several times as long.
    """

    def get(self, index: int | Sequence[int] | slice | Tensor) -> Any:
        """Return the transitions at ``index``, in a tensor int64 [n] where there are several of no order."""
        if self.initialized and isinstance(index, Tensor) and index.dtype == torch.int64 and index.ndim == 1:
            return _rows(self._storage, index)
        return super().get(index)


def _rows(data: TensorDictBase, index: Tensor) -> TensorDict:
    """Return the rows [n, ...] of a tensordict [N, ...]."""
    found = {
        name: _rows(each, index) if is_tensor_collection(each) else each.index_select(0, index)
        for name, each in data.items()
    }
    return TensorDict(found, batch_size=[len(index), *data.batch_size[1:]], device=data.device)
