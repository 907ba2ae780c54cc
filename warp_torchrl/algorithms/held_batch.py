"""Buffer of an on-policy learner: one batch with its advantages, and its minibatches."""

from collections.abc import Iterator, Sequence
from itertools import zip_longest
from typing import Any, Literal

import torch
from tensordict import TensorDictBase
from torch import Tensor
from torchrl.data import SamplerWithoutReplacement, TensorDictReplayBuffer
from torchrl.objectives import LossModule

from warp_torchrl.algorithms import parallel
from warp_torchrl.algorithms.storage import BatchStorage
from warp_torchrl.models import (
    CANONICAL,
    CANONICAL_STATE,
    LOGITS,
    OBSERVATION,
    STATE,
    VALUE,
    CanonicalBatch,
)
from warp_torchrl.system.device import needs_no_sync

ADVANTAGE = ("agents", "advantage")
VALUE_TARGET = ("agents", "value_target")


class HeldBatch:
    """One batch at a time, in TorchRL's buffer: each stored batch replaces the one before.

    Args:
        loss: Whose critic and estimator give the advantages; its ``value_norm``, if it has one, learns the targets.
        canonical: Makes what the loss's networks read.
        dtype: That they compute in.
        frames: World steps of the largest batch.
        steps: World steps of the sequences that are its rows, where actors remember; None for rows of a step.
        minibatch_size: World steps of a minibatch of the largest batch, at most the batch, and in proportion of a
            smaller one; a row at least.
        passes: Over each batch.
        standardises: Of what advantages are standardised over all processes; None leaves it to the loss.
        device: Where it is held.
    """

    def __init__(
        self,
        loss: LossModule,
        canonical: CanonicalBatch,
        dtype: torch.dtype,
        *,
        frames: int,
        steps: int | None,
        minibatch_size: int,
        passes: int,
        standardises: Literal["minibatch", "batch"] | None,
        device: torch.device,
    ) -> None:
        self.loss, self.canonical, self.dtype = loss, canonical, dtype
        self.passes, self.standardises = passes, standardises
        self.holds_sequences = steps is not None
        self.largest = min(minibatch_size, frames) // (steps or 1)
        """Rows of a minibatch of the largest batch."""
        self.rows = BatchStorage(frames // (steps or 1), device=device)
        self.buffer = TensorDictReplayBuffer(storage=self.rows, sampler=SamplerWithoutReplacement())

    def store(self, batch: TensorDictBase) -> None:
        """Take in a collected batch [B, T], of the largest size or smaller."""
        self.buffer.empty()
        valued = with_advantages(self.loss, batch, self.canonical, whole=self.holds_sequences)
        if self.standardises == "batch":
            (valued[ADVANTAGE],) = parallel.standardised([valued[ADVANTAGE]], dim=-2)
        self.buffer.extend(narrowed(valued, self.dtype))

    def samples(self) -> Iterator[TensorDictBase]:
        """Yield the minibatches of all passes, each pass in another order."""
        size = max(1, self.largest * len(self.buffer) // self.rows.max_size)
        norm = getattr(self.loss, "value_norm", None)
        for _ in range(self.passes):
            places = list(minibatches(self.buffer, size))
            if self.standardises == "minibatch":
                yield from _shared(self.rows, places, norm)
            else:
                yield from map(self.rows.get, places)


def minibatches(buffer: TensorDictReplayBuffer, size: int) -> Iterator[Tensor]:
    """Yield the rows of a buffer in minibatches, int64 [size], each row once; the last may be smaller."""
    buffer.sampler.ran_out = False
    while not buffer.sampler.ran_out:
        yield buffer.sampler.sample(buffer.storage, size)[0]


def _shared(rows: BatchStorage, places: Sequence[Tensor], norm: Any) -> Iterator[TensorDictBase]:
    """Yield minibatches with advantages standardised over all processes, with two messages for all of them.

    Args:
        rows: Of the batch.
        places: Which of them are in each minibatch, int64 [n].
        norm: Of value targets, which learns each minibatch's before that is yielded; None where there is none.
    """
    kept = rows.get(slice(0, len(rows))).select(ADVANTAGE, VALUE_TARGET)
    advantages = parallel.standardised([kept[ADVANTAGE][each] for each in places], dim=-2)
    moments = [] if norm is None else norm.moments([kept[VALUE_TARGET][each] for each in places])
    for place, advantage, of_targets in zip_longest(places, advantages, moments):
        if norm is not None:
            norm.learn(of_targets)
        yield rows.get(place).set(ADVANTAGE, advantage)


def with_advantages(
    loss: LossModule, batch: TensorDictBase, canonical: CanonicalBatch, whole: bool = False
) -> TensorDictBase:
    """Add advantages and value targets over time, then drop what the loss does not read.

    Args:
        loss: Whose values and estimator they are of.
        batch: The collected batch, [B, T].
        canonical: Makes what the loss's networks read.
        whole: Whether to return sequences [B, T], and not steps [B T].
    """
    with torch.no_grad():
        batch = canonical(batch)
        _add_values(loss, batch, canonical)
        loss.value_estimator(batch)
    batch = batch.exclude("next", "info", LOGITS, VALUE)
    return batch if whole else batch.reshape(-1)


def narrowed(batch: TensorDictBase, dtype: torch.dtype) -> TensorDictBase:
    """Return a batch whose state, and observation if it is one vector, have the networks' floating-point type.

    They would be made so at every pass, and most of what a minibatch copies is the state.
    """
    wide = {key: batch.get(key, None) for key in (STATE, OBSERVATION, CANONICAL_STATE, CANONICAL)}
    found = {key: value for key, value in wide.items() if isinstance(value, Tensor) and value.dtype == torch.float32}
    return batch.copy().update({key: value.to(dtype) for key, value in found.items()}) if found else batch


def _add_values(loss: LossModule, batch: TensorDictBase, canonical: CanonicalBatch) -> None:
    """Add the values of each step's state and next state, with little more than one pass of the critic.

    The next state is the following step's state, except at the end of an episode or of the batch.
    """
    keys = loss.critic_network.in_keys
    ends = batch["next", "done"][..., 0].clone()
    ends[:, -1] = True
    with loss.critic_network_params.to_module(loss.critic_network):
        value = loss.critic_network(batch.select(*keys))[VALUE]
        following = value.roll(-1, dims=1)
        if needs_no_sync(ends.device):
            following[ends] = loss.critic_network(canonical(batch["next"][ends]))[VALUE]
        else:  # of every step, one after the other: how many ends there are would have to be read
            last = [loss.critic_network(canonical(each))[VALUE] for each in batch["next"].unbind(1)]
            following = torch.where(ends[..., None, None], torch.stack(last, dim=1), following)
    batch.set(VALUE, value)
    batch.set(("next", *VALUE), following)
