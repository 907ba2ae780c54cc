"""Base of the on-policy algorithms: actors, critics, advantages and schedules."""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from itertools import zip_longest
from typing import Any, Literal

import torch
from tensordict import TensorDictBase
from torch import Tensor
from torchrl.data import SamplerWithoutReplacement, TensorDictReplayBuffer
from torchrl.envs import EnvBase
from torchrl.modules import ProbabilisticActor
from torchrl.objectives import LossModule

from warp_torchrl import parallel
from warp_torchrl.algorithms.algorithm import Algorithm, falling, masked_actor
from warp_torchrl.algorithms.learner import Learner
from warp_torchrl.algorithms.storage import BatchStorage
from warp_torchrl.device import reads_freely
from warp_torchrl.models import (
    ACTION,
    CANONICAL,
    CANONICAL_STATE,
    LOG_PROB,
    LOGITS,
    OBSERVATION,
    REWARD,
    STATE,
    VALUE,
    CanonicalBatch,
    Mlp,
    Recollection,
    Signature,
    arithmetic_of,
    over_canonical,
    signature,
)

ADVANTAGE = ("agents", "advantage")
VALUE_TARGET = ("agents", "value_target")
KEYS = {
    "action": ACTION,
    "sample_log_prob": LOG_PROB,
    "value": VALUE,
    "reward": REWARD,
    "done": "done",
    "terminated": "terminated",
    "advantage": ADVANTAGE,
    "value_target": VALUE_TARGET,
}
"""Where TorchRL's losses find their entries."""


@dataclass(frozen=True, kw_only=True)
class OnPolicy(Algorithm):
    """Base class of PPO and A2C.

    Attributes:
        central_critic: Values of the state and each agent's observation, or of the latter alone.
        lmbda: GAE's lambda.
        entropy_coeff: Weight of the entropy bonus at the start.
        entropy_coeff_end: At the end; it falls linearly.
        critic_coeff: Weight of the value loss.
        minibatch_size: World steps in a minibatch of the largest batch (each has one sample an agent), and in
            proportion of a smaller one; where actors remember, in as many whole sequences as fit, one at least.

    Raises:
        ValueError: If a value is out of its range.
    """

    central_critic: bool = True
    lmbda: float = 0.95
    entropy_coeff: float = 0.005
    entropy_coeff_end: float = 0.0005
    critic_coeff: float = 1.0
    minibatch_size: int = 1024

    def check(self, **ranges: tuple[float, float]) -> None:
        """Check the numbers against their ranges, and further fields against ``ranges``."""
        share = (0.0, 1.0)
        own = {"lmbda": share, "entropy_coeff": share, "entropy_coeff_end": share, "critic_coeff": (0.0, 100.0)}
        super().check(minibatch_size=(1, 1_000_000), **own, **ranges)

    def policy(self, shape: Signature, model: Mlp) -> ProbabilisticActor:
        """Return the team's decentralised policy: each agent's action from its own observation and mask."""
        return masked_actor(shape, model)

    def build(self, env: EnvBase, model: Mlp, frames_per_batch: int) -> Learner:
        """Return a learner for an environment.

        Args:
            env: Whose specs it fits, and on whose device it lives.
            model: Makes the networks.
            frames_per_batch: World steps that are collected between updates.
        """
        shape = signature(env)
        policy = self.policy(shape, model).to(env.device)
        critic = model.critic(shape, self.central_critic).to(env.device)
        loss = self.loss(over_canonical(policy), over_canonical(critic)).to(env.device)
        loss.value_estimator.value_network = None  # it reads the values that ``with_advantages`` adds
        optimizer = torch.optim.Adam(loss.parameters(), lr=self.learning_rate, eps=1e-5, fused=True)

        def schedule(progress: float) -> dict[str, float]:
            loss.entropy_coeff.fill_(falling(self.entropy_coeff, self.entropy_coeff_end, progress))
            return {"train/learning_rate": self.rate_at(progress, optimizer), **self.constants()}

        canonical = model.canonical_batch(shape, state=self.central_critic, packed=True)
        memory = Recollection(policy)
        steps = frames_per_batch // env.batch_size[0] if memory.actors else 1  # in a row of the buffer
        rows = BatchStorage(frames_per_batch // steps, device=env.device)
        buffer = TensorDictReplayBuffer(storage=rows, sampler=SamplerWithoutReplacement())
        largest = min(self.minibatch_size // parallel.size(), frames_per_batch) // steps
        standardises = self.standardises() if parallel.size() > 1 else None
        norm = getattr(loss, "value_norm", None)

        def store(batch: TensorDictBase) -> None:
            buffer.empty()
            valued = with_advantages(loss, batch, canonical, whole=bool(memory.actors))
            if standardises == "batch":
                (valued[ADVANTAGE],) = parallel.standardised([valued[ADVANTAGE]], dim=-2)
            buffer.extend(narrowed(valued, arithmetic_of(critic, env.device.type)))

        def samples() -> Iterator[TensorDictBase]:
            size = max(1, largest * len(buffer) * steps // frames_per_batch)
            for _ in range(self.passes()):
                places = list(minibatches(buffer, size))
                yield from map(rows.get, places) if standardises != "minibatch" else _shared(rows, places, norm)

        return Learner(
            policy=policy,
            explore=policy,
            loss=loss,
            terms=loss,
            loss_keys=("loss_objective", "loss_critic", "loss_entropy"),
            columns=self.columns(),
            optimizer=optimizer,
            max_grad_norm=self.max_grad_norm,
            store=store,
            samples=samples,
            after_step=lambda sample: None,
            schedule=schedule,
            keeps={"memory": memory} if memory.actors else {},
            batches_grow=not memory.actors,
        )

    def loss(self, policy: ProbabilisticActor, critic: torch.nn.Module) -> LossModule:
        """Return TorchRL's loss with its value estimator."""
        raise TypeError(f"{type(self).__name__} does not say what it minimises: define loss()")

    def standardises(self) -> Literal["minibatch", "batch"] | None:
        """Return of what advantages are standardised: over all processes, if there are several, else by the loss."""
        return None

    def passes(self) -> int:
        """Return the number of passes over each batch."""
        return 1

    def columns(self) -> dict[str, str]:
        """Return the names of ``metrics.csv`` by entry of the loss's output."""
        return {
            "loss_objective": "train/policy_gradient_loss",
            "loss_critic": "train/value_loss",
            "entropy": "train/entropy",
            "explained_variance": "train/explained_variance",
        }

    def constants(self) -> dict[str, float]:
        """Return the columns that are constant."""
        return {}


def minibatches(buffer: TensorDictReplayBuffer, size: int) -> Iterator[Tensor]:
    """Yield which rows of a buffer are a minibatch, int64 [size], until all have been; the last may be smaller."""
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
    """Return a batch whose state, and observation where it is one vector, have the type that networks compute in.

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
        if reads_freely(ends.device):
            following[ends] = loss.critic_network(canonical(batch["next"][ends]))[VALUE]
        else:  # of every step, one after the other: how many ends there are would have to be read
            last = [loss.critic_network(canonical(each))[VALUE] for each in batch["next"].unbind(1)]
            following = torch.where(ends[..., None, None], torch.stack(last, dim=1), following)
    batch.set(VALUE, value)
    batch.set(("next", *VALUE), following)
