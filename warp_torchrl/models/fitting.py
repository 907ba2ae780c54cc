"""A trained policy in an environment with further channels or actions, matched by name."""

import torch
from tensordict import TensorDictBase
from tensordict.nn import TensorDictModuleBase
from torch import Tensor

from warp_torchrl.models.signature import (
    ACTION,
    ACTION_MASK,
    AGENCY,
    OBSERVATION,
    ROLE,
    SENT,
    Entry,
    Key,
    Signature,
    observation_key,
)


class DelayedMessages(TensorDictModuleBase):
    """A policy with delayed messages in an environment without delay: messages are made from present observations.

    Args:
        policy: Reads senders' observations beside the present one.
    """

    def __init__(self, policy: TensorDictModuleBase) -> None:
        super().__init__()
        self.in_keys = [key for key in policy.in_keys if key[: len(SENT)] != SENT]
        self.out_keys, self.policy = policy.out_keys, policy

    def forward(self, tensordict: TensorDictBase) -> TensorDictBase:
        """Write the policy's outputs."""
        seen = tensordict.select(*self.in_keys, strict=False)
        out = self.policy(seen.set(SENT, seen.get(OBSERVATION)))
        return tensordict.update(out.select(*self.out_keys, strict=False))


class Fitted(TensorDictModuleBase):
    """A policy with only the channels and actions of an environment that it knows.

    Args:
        policy: Observation and mask in, action out.
        channels: For each entry with further channels, by key: the dimension, and the indices of known channels, int64
            [C].
        actions: The environment's code of each action that it knows, int64 [actions].
        fallback: The policy's action that is opened where none of the known ones does anything.
    """

    def __init__(
        self,
        policy: TensorDictModuleBase,
        channels: dict[tuple[str, ...], tuple[int, Tensor]],
        actions: Tensor,
        fallback: int,
    ) -> None:
        super().__init__()
        self.in_keys, self.out_keys = policy.in_keys, policy.out_keys
        self.policy, self.channels, self.actions, self.fallback = policy, channels, actions, fallback

    def forward(self, tensordict: TensorDictBase) -> TensorDictBase:
        """Write the team's actions, int64 [B, A], and the policy's other outputs."""
        seen = tensordict.select(*self.in_keys, strict=False)
        for key, (dim, index) in self.channels.items():
            entry = seen.get(key)
            seen.set(key, entry.index_select(dim, index.to(entry.device)))
        if ACTION_MASK in seen.keys(include_nested=True):
            mask = seen.get(ACTION_MASK)
            mask = mask.index_select(-1, self.actions.to(mask.device))
            mask[..., self.fallback] |= ~mask.any(dim=-1)
            seen.set(ACTION_MASK, mask)
        out = self.policy(seen).select(*self.out_keys, strict=False)
        action = out.get(ACTION)
        return tensordict.update(out.set(ACTION, self.actions.to(action.device)[action]))


def fitted(policy: TensorDictModuleBase, trained: Signature, here: Signature, fallback: int) -> TensorDictModuleBase:
    """Return a policy for an environment, whose channels and actions are matched by name.

    Args:
        policy: Observation and mask in, action out.
        trained: Signature of its training.
        here: Signature of the environment.
        fallback: The policy's action that is opened where none of the known ones does anything.

    Raises:
        ValueError: If the environment lacks an entry, a channel or an action, has another shape or type, or has a role
            or agencies without a network in the policy; the message names it.
    """
    trained, here = trained.bare(), here.bare()
    if AGENCY in policy.in_keys and here.agencies != trained.agencies:
        raise ValueError(
            f"it has a network for each of {len(trained.agencies)} agencies, this environment has "
            f"{len(here.agencies) or 1}"
        )
    if trained.is_late and not here.is_late and any(key[: len(SENT)] == SENT for key in policy.in_keys):
        policy = DelayedMessages(policy)
    if (trained.observation, trained.actions, trained.roles) == (here.observation, here.actions, here.roles):
        return policy
    lacking = [name for name in trained.actions if name not in here.actions]
    if lacking:
        raise ValueError(
            f"it was trained with {len(trained.actions)} actions, this environment has {len(here.actions)}: "
            f"{', '.join(lacking)}"
        )
    if ROLE in policy.in_keys and here.roles != trained.roles[: len(here.roles)]:
        raise ValueError(
            f"it has a network for each of the roles {', '.join(trained.roles)}, this environment has "
            f"{', '.join(here.roles)}"
        )
    channels: dict[Key, tuple[int, Tensor]] = {}
    for name, entry in trained.observation.items():
        if name not in here.observation:
            raise ValueError(f"it was trained to see {name or 'a vector'}, which this environment does not show")
        index = _places(name, entry, here.observation[name])
        if index is not None:
            both = (observation_key(name, sent) for sent in (False, True))
            channels |= {key: (-len(entry.shape), index) for key in both if key in policy.in_keys}
    return Fitted(policy, channels, torch.tensor([here.actions.index(name) for name in trained.actions]), fallback)


def _places(name: str, trained: Entry, here: Entry) -> Tensor | None:
    """Return the indices of the trained channels among those of the environment; None where both are the same."""
    if trained[:3] == here[:3]:
        return None
    lacking = [each for each in trained.names if each not in here.names]
    if lacking and here.names:
        raise ValueError(f"it was trained to see {', '.join(lacking)} in {name}, which this environment does not show")
    if not trained.names or lacking or (trained.shape[1:], trained.dtype) != (here.shape[1:], here.dtype):
        raise ValueError(
            f"it was trained on {name or 'vector'} {list(trained.shape)} {trained.dtype}, this environment shows "
            f"{list(here.shape)} {here.dtype}"
        )
    return torch.tensor([here.names.index(each) for each in trained.names])
