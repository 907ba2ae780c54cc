"""Actors with a memory: a recurrent layer, and its state from one step to the next."""

from collections.abc import Iterator, Mapping, Sequence
from contextlib import contextmanager
from typing import Any

import torch
from tensordict import TensorDictBase
from tensordict.nn import TensorDictModuleBase
from torch import Tensor, nn

from warp_torchrl.models.canonical import Orientation
from warp_torchrl.models.networks import Network
from warp_torchrl.models.signature import AGENCY, LOGITS, MEMORY, ORIENTATION, ROLE, Entry, Key


class RecurrentNetwork(nn.Module):
    """A network with a gated recurrent unit (Cho et al. 2014) beside its first layer: what it sees reaches the layers
    above as it does without, and what it remembers is added to that.

    The canonical orientation changes every few steps. A memory has units for each of the eight orientations, which
    change places with them (the regular representation of the square's symmetries, as in Cohen and Welling, "Group
    equivariant convolutional networks", 2016): what was remembered of the map stays true of it.

    Args:
        network: The network without it; the recurrent layer is float32 whatever its arithmetic.
        size: Features of its first layer.
        memory: Units of the recurrent layer, a multiple of 8.
    """

    def __init__(self, network: Network, size: int, memory: int) -> None:
        super().__init__()
        self.network, self.memory = network, memory
        self.cell = nn.GRUCell(size, memory)
        self.recall = nn.Linear(memory, size, bias=False)
        for weight in (self.cell.weight_ih, self.cell.weight_hh, self.recall.weight):
            nn.init.orthogonal_(weight)
        nn.init.zeros_(self.cell.bias_ih)
        nn.init.zeros_(self.cell.bias_hh)

    @property
    def entries(self) -> list[Entry]:
        """Entries that it reads: those of its network, whether an episode begins, its orientation, and the memory."""
        return [*self.network.entries, Entry((), "bool"), Entry((), "int64"), Entry((self.memory,), "float32")]

    def forward(self, *inputs: Tensor) -> Tensor:
        """Return its output and the new memory, float32 [..., out + M].

        Args:
            inputs: Entries [...], whether an episode begins bool [...], the index of their ``Orientation`` int64 [...],
                and the memory before, float32 [..., M], in the map's orientation; or, for a sequence, the former with
                time as dimension 1 and the memory before the first step.
        """
        *seen, fresh, index, memory = inputs
        device, network = fresh.device.type, self.network
        with network.arithmetic(device):
            features = network.body[0](network.encoder(*seen))
        with torch.autocast(device, enabled=False):
            remembered = self._remember(features.to(torch.float32), (~fresh)[..., None], index, memory)
        with network.arithmetic(device):
            out = network.body[1:](features + self.recall(remembered))
        return torch.cat((out.to(torch.float32), Orientation(index).units_back(remembered)), dim=-1)

    def _remember(self, features: Tensor, kept: Tensor, index: Tensor, memory: Tensor) -> Tensor:
        """Return the memory after each step, in its orientation; where ``kept`` is 0, the memory before is dropped."""
        if features.ndim == memory.ndim:
            return self._step(features, Orientation(index).units(kept * memory))
        after = []
        for now, stays, way in zip(features.unbind(1), kept.unbind(1), index.unbind(1), strict=True):
            turned = self._step(now, Orientation(way).units(stays * memory))
            memory = Orientation(way).units_back(turned)
            after.append(turned)
        return torch.stack(after, dim=1)

    def _step(self, features: Tensor, memory: Tensor) -> Tensor:
        return self.cell(features.flatten(0, -2), memory.flatten(0, -2)).view(memory.shape)


class RecurrentActor(TensorDictModuleBase):
    """The module of a team whose agents each remember their observations since the episode began.

    Called with the tensordict [B] of one step it continues from the step before, which must have been of the same
    worlds; it forgets where an episode begins, which the agents' clock shows. Called with sequences [B, T] it continues
    from the memory that was recorded with each, and the stored memory does not change.

    Args:
        network: Reads the entries, whether an episode begins, the orientation and the memory, and the role if each role
            has a network; writes logits and memory, float32 [..., A, actions + M].
        keys: Of the entries, of the orientation where they have one, and of the role.
        n_actions: Entries of the logits.
        memory: M.
        clock: Key of the vector with the share of the episode that is left, and its index there.
    """

    def __init__(
        self, network: nn.Module, keys: list[Any], n_actions: int, memory: int, clock: tuple[Key, int]
    ) -> None:
        super().__init__()
        self.in_keys, self.out_keys = [*keys, MEMORY], [LOGITS, MEMORY]
        self.network, self.size, self._clock = network, [n_actions, memory], clock
        self._seen = [key for key in keys if key not in (ROLE, AGENCY, ORIENTATION)]
        self.remembered = torch.zeros(0, 0, memory)  # [B, A, M], of the last step's worlds

    def forward(self, tensordict: TensorDictBase) -> TensorDictBase:
        """Write logits, and the memory before the step."""
        key, place = self._clock
        whole = tensordict.ndim == 2
        before = tensordict.get(MEMORY)[:, 0] if whole else self._before(tensordict.get(key)[..., place])
        logits, after = self.step(tensordict, before)
        if not whole:
            tensordict.set(MEMORY, before)
            self.remembered = after.detach()
        return tensordict.set(LOGITS, logits)

    def step(self, tensordict: TensorDictBase, before: Tensor) -> tuple[Tensor, Tensor]:
        """Return logits [..., A, actions] and the memory after the step [..., A, M]; nothing is kept.

        Args:
            tensordict: The entries.
            before: Memory before the step, float32 [B, A, M].
        """
        key, place = self._clock
        fresh = tensordict.get(key)[..., place] == 1.0
        seen = [tensordict.get(key) for key in self._seen]
        kind = [tensordict.get(key) for key in (ROLE, AGENCY) if key in self.in_keys]
        turned = ORIENTATION in self.in_keys
        index = tensordict.get(ORIENTATION) if turned else torch.zeros_like(fresh, dtype=torch.int64)
        logits, after = self.network(*seen, fresh, index, before, *kind).split(self.size, dim=-1)
        return logits, after

    def _before(self, clock: Tensor) -> Tensor:
        """Return the memory of the agents of a clock [B, A] after the step before, float32 [B, A, M]; 0 of others."""
        if self.remembered.shape[:-1] != clock.shape:
            return torch.zeros(*clock.shape, self.size[1], device=clock.device)
        return self.remembered.to(clock.device)  # where a policy was moved, its memory is still where it was


class Memories:
    """Memories of the recurrent actors of a policy, float32 [B, A, M] each.

    Args:
        policy: Policy with any number of recurrent actors.
    """

    def __init__(self, policy: nn.Module) -> None:
        self.actors = recurrent_actors(policy)

    @property
    def remembered(self) -> list[Tensor]:
        """The memory of each."""
        return [actor.remembered for actor in self.actors]

    @remembered.setter
    def remembered(self, memories: Sequence[Tensor]) -> None:
        for actor, memory in zip(self.actors, memories, strict=True):
            actor.remembered = memory


class RemembersApart(TensorDictModuleBase):
    """A policy that keeps the memory of one kind of worlds, whatever it plays in between.

    Args:
        policy: Policy with recurrent actors, which several such modules may share.
    """

    def __init__(self, policy: TensorDictModuleBase) -> None:
        super().__init__()
        self.in_keys, self.out_keys = policy.in_keys, policy.out_keys
        self.policy, self._actors = policy, Memories(policy)
        self.remembered = [torch.zeros_like(memory) for memory in self._actors.remembered]

    def forward(self, tensordict: TensorDictBase) -> TensorDictBase:
        """Write what the policy does."""
        others, self._actors.remembered = self._actors.remembered, self.remembered
        out = self.policy(tensordict)
        self.remembered, self._actors.remembered = self._actors.remembered, others
        return out


class Recollection:
    """A policy's memory in a checkpoint, besides its weights.

    Args:
        policy: Policy with any number of recurrent actors, or one that remembers apart.
    """

    def __init__(self, policy: nn.Module) -> None:
        self._policy = policy
        self._memories = policy if isinstance(policy, RemembersApart) else Memories(policy)

    def state_dict(self) -> dict[str, Tensor]:
        """Return the memory of each actor."""
        return {str(index): memory.clone() for index, memory in enumerate(self._memories.remembered)}

    def load_state_dict(self, state_dict: Mapping[str, Tensor]) -> None:
        """Remember it."""
        memories = (state_dict[str(index)] for index in range(len(state_dict)))
        self._memories.remembered = [memory.to(next(self._policy.parameters()).device) for memory in memories]


def recurrent_actors(policy: nn.Module) -> list[RecurrentActor]:
    """Return the parts of a policy that remember."""
    return [each for each in policy.modules() if isinstance(each, RecurrentActor)]


@contextmanager
def memory_apart(policy: nn.Module) -> Iterator[None]:
    """Let a policy act elsewhere within a context, and restore its memory after it."""
    memory = Recollection(policy)
    before = memory.state_dict()
    try:
        yield
    finally:
        memory.load_state_dict(before)
