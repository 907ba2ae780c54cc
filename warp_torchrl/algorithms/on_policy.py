"""What the on-policy algorithms share: actors and critics, advantages over time, and what falls with progress."""

from dataclasses import dataclass, fields

import torch
from tensordict import TensorDictBase
from torchrl.data import LazyTensorStorage, SamplerWithoutReplacement, TensorDictReplayBuffer
from torchrl.envs import EnvBase
from torchrl.modules import MaskedCategorical, ProbabilisticActor
from torchrl.objectives import LossModule

from warp_torchrl.algorithms.learner import Learner
from warp_torchrl.models import ACTION, ACTION_MASK, LOG_PROB, LOGITS, REWARD, VALUE, Mlp, Signature, signature

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
_RANGES = {
    "gamma": (0.0, 1.0),
    "lmbda": (0.0, 1.0),
    "entropy_coeff": (0.0, 1.0),
    "entropy_coeff_end": (0.0, 1.0),
    "critic_coeff": (0.0, 100.0),
    "learning_rate": (0.0, 1.0),
    "learning_rate_end": (0.0, 1.0),
    "max_grad_norm": (1e-6, 1e6),
}


@dataclass(frozen=True, kw_only=True)
class OnPolicy:
    """What PPO and A2C have in common.

    Attributes:
        central_critic: Values from the whole state, or from each agent's observation.
        gamma: Discount.
        lmbda: GAE's lambda.
        entropy_coeff: Weight of the entropy bonus at the start.
        entropy_coeff_end: At the end; it falls linearly.
        critic_coeff: Weight of the value loss.
        learning_rate: Of Adam at the start.
        learning_rate_end: At the end, as a share of the start; it falls linearly.
        max_grad_norm: Gradient clipping.

    Raises:
        ValueError: If a value is out of its range.
    """

    central_critic: bool = True
    gamma: float = 0.99
    lmbda: float = 0.95
    entropy_coeff: float = 0.01
    entropy_coeff_end: float = 0.001
    critic_coeff: float = 1.0
    learning_rate: float = 1e-3
    learning_rate_end: float = 0.05
    max_grad_norm: float = 0.5

    def __post_init__(self) -> None:
        self.check()

    def check(self, **ranges: tuple[float, float]) -> None:
        """Check the numbers against their ranges, and further fields against ``ranges``."""
        allowed = _RANGES | ranges
        for field in fields(self):
            low, high = allowed.get(field.name, (False, True))
            if not low <= getattr(self, field.name) <= high:
                raise ValueError(f"{field.name} must be in [{low:g}, {high:g}], got {getattr(self, field.name)}")

    def policy(self, shape: Signature, model: Mlp) -> ProbabilisticActor:
        """Return the team's decentralised policy: each agent's action from its own observation and mask."""
        return ProbabilisticActor(
            model.actor(shape),
            in_keys={"logits": LOGITS, "mask": ACTION_MASK},
            out_keys=[ACTION],
            distribution_class=MaskedCategorical,
            distribution_kwargs={"use_cross_entropy": False},
            return_log_prob=True,
            log_prob_key=LOG_PROB,
        )

    def build(self, env: EnvBase, model: Mlp, frames_per_batch: int) -> Learner:
        """Return a learner for an environment.

        Args:
            env: Whose specs it fits, and on whose device it lives.
            model: Makes the networks.
            frames_per_batch: World steps that are collected between updates.
        """
        shape = signature(env)
        policy = self.policy(shape, model).to(env.device)
        loss = self.loss(policy, model.critic(shape, self.central_critic).to(env.device)).to(env.device)
        optimizer = torch.optim.Adam(loss.parameters(), lr=self.learning_rate, eps=1e-5)

        def schedule(progress: float) -> dict[str, float]:
            rate = self.learning_rate * (1.0 + (self.learning_rate_end - 1.0) * progress)
            entropy = self.entropy_coeff + (self.entropy_coeff_end - self.entropy_coeff) * progress
            for group in optimizer.param_groups:
                group["lr"] = rate
            loss.entropy_coeff.fill_(entropy)
            return {"train/learning_rate": rate, **self.constants()}

        buffer = TensorDictReplayBuffer(
            storage=LazyTensorStorage(frames_per_batch, device=env.device),
            sampler=SamplerWithoutReplacement(),
            batch_size=min(self.samples(frames_per_batch), frames_per_batch),
        )
        return Learner(
            policy=policy,
            explore=policy,
            loss=loss,
            loss_keys=("loss_objective", "loss_critic", "loss_entropy"),
            columns=self.columns(),
            optimizer=optimizer,
            max_grad_norm=self.max_grad_norm,
            prepare=lambda batch: with_advantages(loss, batch),
            buffer=buffer,
            keeps_data=False,
            passes=self.passes(),
            schedule=schedule,
        )

    def loss(self, policy: ProbabilisticActor, critic: torch.nn.Module) -> LossModule:
        """Return TorchRL's loss with its value estimator."""
        raise TypeError(f"{type(self).__name__} does not say what it minimises: define loss()")

    def samples(self, frames_per_batch: int) -> int:
        """Return the world steps of a minibatch."""
        return frames_per_batch

    def passes(self) -> int:
        """Return how often each collected step is seen."""
        return 1

    def columns(self) -> dict[str, str]:
        """Return the names of ``metrics.csv`` by entry of the loss's output."""
        return {
            "loss_objective": "train/policy_gradient_loss",
            "loss_critic": "train/value_loss",
            "loss_entropy": "train/entropy_loss",
        }

    def constants(self) -> dict[str, float]:
        """Return columns that do not change."""
        return {}


def with_advantages(loss: LossModule, batch: TensorDictBase) -> TensorDictBase:
    """Add advantages and value targets over time, then drop what the loss does not read; [B, T] -> [B T]."""
    with torch.no_grad():
        loss.value_estimator(batch, params=loss.critic_network_params, target_params=loss.target_critic_network_params)
    return batch.exclude("next", "info", LOGITS, VALUE).reshape(-1)
