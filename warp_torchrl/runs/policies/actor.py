"""The actor of one vehicle, as a module of plain tensors: what leaves this project."""

from copy import deepcopy
from typing import Any

import torch
from tensordict import TensorDict, TensorDictBase
from tensordict.nn import TensorDictModule, TensorDictModuleBase, TensorDictSequential
from torch import Tensor, nn

from warp_torchrl.models import (
    ACTION_VALUE,
    AGENCY,
    LOGITS,
    RADIO,
    ROLE,
    RecurrentActor,
    Signature,
)
from warp_torchrl.models.canonical import Canonicalise
from warp_torchrl.models.messages import TalkingNetwork
from warp_torchrl.models.networks import AgentNetworks, IndexedNetworks, Network
from warp_torchrl.models.signature import Key, observation_key
from warp_torchrl.runs.checkpoint import CheckpointError
from warp_torchrl.runs.policies.trained import TrainedPolicy

_OBSERVATION = "observation"
"""Name of the input where the observation is one tensor."""


class Actor(nn.Module):
    """The decentralised policy of one vehicle: n observations in, n actions out; the rows do not read each other.

    It computes in float32 and chooses the likeliest action that the mask allows. Inputs, in the order of ``reads``:

    - the entries of the observation by name, [n, ...]
    - ``action_mask``, bool [n, actions]
    - ``role``, ``agency`` or ``agent``, int64 [n], where each of them has a network
    - ``memory``, float32 [n, M], of an actor that remembers: zeros, then ``next_memory`` of the step before
    - ``radio``, float32 [n, K, 3], and ``messages``, float32 [n, K, M], of an actor that talks, from K others: 1 if it
      is heard, else 0; rows and columns from the vehicle to the other [cells]

    Outputs, in the order of ``writes``: ``action`` int64 [n], ``logits`` float32 [n, actions] without the mask (the
    values of the actions where it was trained by Q-learning), ``next_memory`` and ``message``.

    Args:
        policy: The trained policy; it is copied.

    Raises:
        CheckpointError: If its agents exchange several rounds of messages in a step, or it writes no logits.
    """

    def __init__(self, policy: TrainedPolicy) -> None:
        super().__init__()
        shape = self.signature = policy.trained
        parts = [_of_one(part, shape) for part in _parts(_scoring(deepcopy(policy.module)))]
        self.parts = nn.ModuleList(parts)
        for module in self.modules():
            if isinstance(module, Network):
                module.dtype = "float32"
        self._key = LOGITS if LOGITS in parts[-1].out_keys else ACTION_VALUE
        self._index, index = _indexed(policy)
        recurrent = [part for part in parts if isinstance(part, RecurrentActor)]
        talking = [network for part in parts if (network := _talking(part)) is not None]
        rounds = len(talking[0].rounds) if talking else 0
        if rounds > 1:
            raise CheckpointError(f"its agents exchange {rounds} rounds of messages in a step: export takes one round")
        self.memory_size = recurrent[0].size[1] if recurrent else 0
        """Numbers of a memory; 0 without one."""
        self.message_size = talking[0].message if talking else 0
        """Numbers of a message; 0 without any."""
        self.is_late = bool(talking) and talking[0].is_late
        """Whether messages arrive late."""
        self.entries = {name or _OBSERVATION: observation_key(name) for name in shape.observation}
        """Keys of the observation by the name of the input."""
        state = [*(["memory"] if recurrent else []), *(["radio", "messages"] if talking else [])]
        self.reads = (*self.entries, "action_mask", *([index] if index else []), *state)
        """Names of the inputs, in order."""
        told = [*(["next_memory"] if recurrent else []), *(["message"] if talking else [])]
        self.writes = ("action", "logits", *told)
        """Names of the outputs, in order."""
        self.index = index
        """Name of the input by which a network is chosen; empty where there is but one."""
        self.requires_grad_(False).eval()

    def forward(self, *inputs: Tensor) -> tuple[Tensor, ...]:
        """Return the outputs by the order of ``writes``."""
        given = dict(zip(self.reads, inputs, strict=True))
        mask = given["action_mask"]
        team = TensorDict({}, batch_size=mask.shape[:1])  # each row is a team of one
        for name, key in self.entries.items():
            team.set(key, given[name][:, None])
        if self._index is not None:
            team.set(self._index, given[self.index][:, None])
        told: list[Tensor] = []
        for part in self.parts:
            told += self._pass(part, team, given)
        scores = team.get(self._key)[:, 0]
        action = scores.masked_fill(~mask, -torch.inf).argmax(-1)
        return action, scores, *told

    def _pass(self, part: Any, team: TensorDictBase, given: dict[str, Tensor]) -> list[Tensor]:
        """Let a part write into the tensordict, and return the memory or the messages that it makes, [n, ...]."""
        talking = _talking(part)
        if isinstance(part, RecurrentActor):  # not by identity: torch's tracer puts others in the place of modules
            scores, told = part.step(team, given["memory"][:, None])
        elif talking is not None:
            keys = [key for key in part.in_keys if key != RADIO]
            seen = [team.get(key) for key in (keys[: len(keys) // 2] if self.is_late else keys)]
            scores, told = talking.exchange(given["radio"][:, None], given["messages"][:, None], *seen)
        else:
            part(team)
            return []
        team.set(self._key, scores)
        return [told[:, 0]]


def _scoring(policy: TensorDictModuleBase) -> TensorDictModuleBase:
    """Return the part of a policy that writes logits or action values.

    Raises:
        CheckpointError: If there is none.
    """
    first = policy.module[0] if isinstance(policy, TensorDictSequential) else policy
    if not {LOGITS, ACTION_VALUE} & set(first.out_keys):
        raise CheckpointError("it has neither logits nor values of actions: there is nothing to export")
    return first


def _parts(module: TensorDictModuleBase) -> list[TensorDictModuleBase]:
    if isinstance(module, TensorDictSequential):
        return [part for each in module.module for part in _parts(each)]
    return [module]


def _of_one(part: TensorDictModuleBase, shape: Signature) -> TensorDictModuleBase:
    """Return a part of a team's policy for one vehicle: one of several agents' networks is chosen by its index."""
    if isinstance(part, Canonicalise):
        return Canonicalise(shape.observation)  # messages arrive made: nothing is read of when they were sent
    network = part.network if isinstance(part, RecurrentActor) else getattr(part, "module", None)
    if not isinstance(network, AgentNetworks):
        return part
    chosen = IndexedNetworks(list(network.networks))
    if isinstance(part, RecurrentActor):
        part.network, part.in_keys = chosen, [*part.in_keys, ROLE]
        return part
    return TensorDictModule(chosen, in_keys=[*part.in_keys, ROLE], out_keys=part.out_keys)


def _indexed(policy: TrainedPolicy) -> tuple[Key | None, str]:
    """Return the key by which a network is chosen, and the name of its input; agents take the place of roles."""
    if policy.is_by_agent:
        return ROLE, "agent"
    return next(((key, key[-1]) for key in (ROLE, AGENCY) if key in policy.in_keys), (None, ""))


def _talking(part: nn.Module) -> TalkingNetwork | None:
    """Return the network of a part whose agents exchange messages; None of other parts."""
    network = getattr(part, "module", None)
    return network if isinstance(network, TalkingNetwork) else None
