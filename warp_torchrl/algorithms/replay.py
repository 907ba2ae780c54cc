"""Replay memory: TorchRL's buffers, uniform or prioritised, and their state in checkpoints."""

from dataclasses import dataclass
from typing import Any

import torch
from tensordict import TensorDict, TensorDictBase, is_tensor_collection
from torchrl.data import (
    ReplayBuffer,
    TensorDictPrioritizedReplayBuffer,
    TensorDictReplayBuffer,
)
from torchrl.data.replay_buffers import PrioritizedSampler

from warp_torchrl.algorithms.storage import RowStorage

_TREES = {"_sum_tree", "_min_tree"}  # where TorchRL's prioritised sampler keeps the priorities
_ALPHA, _BETA = 0.6, 0.4  # Schaul et al., 2016, proportional prioritisation


def replay_buffer(kind: str, capacity: int, minibatch_size: int, device: torch.device) -> ReplayBuffer:
    """Return TorchRL's replay buffer.

    Args:
        kind: ``uniform`` or ``prioritised``, by the entry ``td_error``.
        capacity: World steps that it holds.
        minibatch_size: World steps in a sample.
        device: Where it holds them.
    """
    storage = RowStorage(capacity, device=device)
    if kind == "uniform":
        return TensorDictReplayBuffer(storage=storage, batch_size=minibatch_size)
    # A generator of its own: without one the sampler draws from NumPy's, which no seed of ours reaches.
    generator = torch.Generator().manual_seed(int(torch.randint(2**31, ())))
    return TensorDictPrioritizedReplayBuffer(
        alpha=_ALPHA,
        beta=_BETA,
        storage=storage,
        batch_size=minibatch_size,
        priority_key="td_error",
        generator=generator,
    )


def weighted(sample: TensorDictBase) -> TensorDictBase:
    """Expand the importance weights of prioritised replay to the agents, as TorchRL's losses need; else no change."""
    weight = sample.get("priority_weight", None)
    return sample if weight is None else sample.set("priority_weight", weight[:, None].expand(sample["agents"].shape))


@dataclass(frozen=True)
class ReplayMemory:
    """A replay buffer whose state is its stored transitions, without its empty capacity.

    Attributes:
        buffer: TorchRL's.
    """

    buffer: ReplayBuffer

    def state_dict(self) -> dict[str, Any]:
        """Return the transitions, the batch sizes of nested tensordicts, and the write position."""
        state = self.buffer.state_dict() | {"_storage": {}, "sizes": {}}
        places = torch.arange(len(self.buffer))
        for name in _TREES & state["_sampler"].keys():  # objects of the extension, which only pickle could write
            tree = state["_sampler"][name]
            state["_sampler"][name] = tree[places] if len(places) else torch.empty(0)
        if len(self.buffer):
            data = self.buffer[:]
            nested = [key for key in data.keys(True, False, sort=True) if is_tensor_collection(data.get(key))]
            state["_storage"] = dict(data.flatten_keys(".").items())
            state["sizes"] = {".".join((key,) if isinstance(key, str) else key): data[key].batch_size for key in nested}
        return state

    def load_state_dict(self, state_dict: dict[str, Any]) -> None:
        """Restore what ``state_dict`` returned; the rest of the buffer stays empty."""
        self.buffer.empty()
        if state_dict["_storage"]:
            length = len(next(iter(state_dict["_storage"].values())))
            data = TensorDict(state_dict["_storage"], batch_size=[length]).unflatten_keys(".")
            for key, size in state_dict["sizes"].items():
                data[tuple(key.split("."))].batch_size = size
            self.buffer.extend(data)
        now = self.buffer.state_dict()
        sampler = dict(state_dict["_sampler"])
        for name in _TREES & sampler.keys():
            tree = now["_sampler"][name]
            if len(sampler[name]):
                tree[torch.arange(len(sampler[name]))] = sampler[name]
            sampler[name] = tree
        self.buffer.load_state_dict(state_dict | {"_storage": now["_storage"], "_sampler": sampler})


def check_prioritised() -> None:
    """Check that TorchRL's prioritised sampler works here.

    Raises:
        ValueError: If TorchRL's compiled extension does not load.
    """
    try:
        PrioritizedSampler(1, _ALPHA, _BETA)
    except (RuntimeError, ImportError):
        raise ValueError(
            f"replay must be uniform here: prioritised replay needs TorchRL's compiled extension, which does not load "
            f"with torch {torch.__version__}"
        ) from None
