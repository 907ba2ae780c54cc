"""Networks that hold the map so that the fire lies before them."""

from collections.abc import Iterable
from copy import deepcopy
from typing import TypeVar

import torch
from tensordict import TensorDictBase
from torch import Tensor, nn

from warp_torchrl.models.signature import (
    ACTION,
    ACTION_MASK,
    ACTION_ONE_HOT,
    FRAME,
    MEMORY,
    OBSERVATION,
    STATE,
    TEACHER_ACTION,
)
from warp_torchrl.observation.frame import FIRE_CHANNEL, frame_of, held, held_state

Key = str | tuple[str, ...]
Module = TypeVar("Module", bound=nn.Module)


class FacingFire(nn.Module):
    """Networks of agents in frames of their own, in which the fire that an agent sees lies between east and south-east.

    What they are given and what they say are of the map; each agent's part is turned and mirrored on the way in and
    back on the way out, and the critic's state as the middle of the team would hold it.

    Args:
        network: Reads entries [..., A, ...] and, where it is central, the state; writes [..., A, out].
        keys: Of what is read, in order.
        actions: How many of the entries that it writes, the first, are one for each action.
        fire: Which channel of a view tells where fire is.
    """

    def __init__(self, network: nn.Module, keys: list[Key], actions: int, fire: int) -> None:
        super().__init__()
        self.network, self.keys, self.actions, self.fire = network, keys, actions, fire
        self._names = _observed(keys)

    def forward(self, *inputs: Tensor) -> Tensor:
        """Return float32 [..., A, out]."""
        given = dict(zip(self.keys, inputs, strict=True))
        frame = frame_of({name: given[key] for key, name in self._names.items()}, self.fire)
        for key, name in self._names.items():
            given[key] = held(name, given[key], frame)
        if STATE in given:
            given[STATE] = held_state(given[STATE])
        if FRAME in given:
            given[FRAME] = frame.index
        if ACTION_ONE_HOT in given:
            given[ACTION_ONE_HOT] = frame.actions(given[ACTION_ONE_HOT])
        out = self.network(*given.values())
        if not self.actions:
            return out
        turned = frame.actions_on_map(out[..., : self.actions])
        return turned if out.shape[-1] == self.actions else torch.cat((turned, out[..., self.actions :]), dim=-1)


class StateFacingFire(nn.Module):
    """A network of the team that holds the state as its middle does, see ``held_state``.

    Args:
        network: Reads whatever it reads, and the state last.
    """

    def __init__(self, network: nn.Module) -> None:
        super().__init__()
        self.network = network

    def forward(self, *inputs: Tensor) -> Tensor:
        """Return what the network writes."""
        *others, state = inputs
        return self.network(*others, held_state(state))


class _Held(nn.Module):
    """Networks that are given entries as they hold them; their weights have the names that they have elsewhere."""

    def __init__(self, network: nn.Module) -> None:
        super().__init__()
        self.network = network

    def forward(self, *inputs: Tensor) -> Tensor:
        return self.network(*inputs)


def fire_channel(module: nn.Module) -> int | None:
    """Return by which channel of a view networks of a module face the fire; None where none does."""
    return next((each.fire for each in module.modules() if isinstance(each, FacingFire)), None)


def given_held(module: Module) -> Module:
    """Return the same module over what ``hold`` returns, of the same weights: what is seen often is turned once."""
    twin = deepcopy(module, {id(weight): weight for weight in module.parameters()})
    for parent in list(twin.modules()):
        for name, child in list(parent.named_children()):
            if isinstance(child, FacingFire):
                setattr(parent, name, _Held(child.network))
    return twin


def hold(batch: TensorDictBase, fire: int = FIRE_CHANNEL) -> TensorDictBase:
    """Return a batch as its agents hold it: observations, masks and actions, and the critic's state.

    Args:
        batch: As it was collected; what is in it of ``ACTION``, ``ACTION_MASK``, ``TEACHER_ACTION`` and ``STATE`` is
            turned with what was seen. Entries of its ``next`` are not. Where its agents remember, how each holds the
            map is added as ``FRAME``.
        fire: Which channel of a view tells where fire is.
    """
    names = _observed(batch.keys(include_nested=True, leaves_only=True))
    frame = frame_of({name: batch.get(key) for key, name in names.items()}, fire)
    out = batch.copy()
    for key, name in names.items():
        out.set(key, held(name, batch.get(key), frame))
    for key in (ACTION, TEACHER_ACTION):
        if key in batch.keys(include_nested=True):
            out.set(key, frame.action(batch.get(key)))
    if ACTION_MASK in batch.keys(include_nested=True):
        out.set(ACTION_MASK, frame.actions(batch.get(ACTION_MASK)))
    if MEMORY in batch.keys(include_nested=True):
        out.set(FRAME, frame.index)
    if STATE in batch.keys():
        out.set(STATE, held_state(batch.get(STATE)))
    return out


def _observed(keys: Iterable[Key]) -> dict[Key, str]:
    """Return the names of the observation's entries by their keys."""
    return {key: "".join(key[len(OBSERVATION) :]) for key in keys if key[: len(OBSERVATION)] == OBSERVATION}
