"""Proximal policy optimisation for teams: MAPPO with a central critic, IPPO with local ones, from TorchRL's loss.

Yu et al., "The Surprising Effectiveness of PPO in Cooperative Multi-Agent Games", 2022; Schulman et al., "Proximal
Policy Optimization Algorithms", 2017.
"""

from dataclasses import dataclass, fields

import torch
from tensordict import TensorDictBase
from torchrl.data import LazyTensorStorage, SamplerWithoutReplacement, TensorDictReplayBuffer
from torchrl.envs import EnvBase
from torchrl.modules import MaskedCategorical, PopArtValueNorm, ProbabilisticActor
from torchrl.objectives.multiagent import IPPOLoss, MAPPOLoss

from warp_torchrl.algorithms.learner import Learner
from warp_torchrl.models import ACTION, ACTION_MASK, LOG_PROB, LOGITS, REWARD, VALUE, Mlp, Signature, signature

_ADVANTAGE = ("agents", "advantage")
_VALUE_TARGET = ("agents", "value_target")
_COLUMNS = {
    "loss_objective": "train/policy_gradient_loss",
    "loss_critic": "train/value_loss",
    "loss_entropy": "train/entropy_loss",
    "kl_approx": "train/approx_kl",
    "clip_fraction": "train/clip_fraction",
    "explained_variance": "train/explained_variance",
}


@dataclass(frozen=True, kw_only=True)
class Ppo:
    """Clipped PPO with multi-agent generalised advantage estimation.

    Attributes:
        central_critic: Values from the whole state (MAPPO), or from each agent's observation (IPPO).
        gamma: Discount.
        lmbda: GAE's lambda.
        clip_epsilon: Clip range of the probability ratio.
        entropy_coeff: Weight of the entropy bonus at the start.
        entropy_coeff_end: At the end; it falls linearly.
        critic_coeff: Weight of the value loss.
        value_norm: Whether value targets are normalised by running statistics.
        learning_rate: Of Adam at the start.
        learning_rate_end: At the end, as a share of the start; it falls linearly.
        epochs: Passes over each batch.
        minibatch_size: World steps in a minibatch (each has one sample an agent).
        max_grad_norm: Gradient clipping.

    Raises:
        ValueError: If a value is out of its range.
    """

    central_critic: bool = True
    gamma: float = 0.99
    lmbda: float = 0.95
    clip_epsilon: float = 0.2
    entropy_coeff: float = 0.01
    entropy_coeff_end: float = 0.001
    critic_coeff: float = 1.0
    value_norm: bool = True
    learning_rate: float = 1e-3
    learning_rate_end: float = 0.05
    epochs: int = 3
    minibatch_size: int = 2048
    max_grad_norm: float = 0.5

    def __post_init__(self) -> None:
        ranges = {
            "gamma": (0.0, 1.0),
            "lmbda": (0.0, 1.0),
            "clip_epsilon": (1e-4, 1.0),
            "entropy_coeff": (0.0, 1.0),
            "entropy_coeff_end": (0.0, 1.0),
            "critic_coeff": (0.0, 100.0),
            "learning_rate": (0.0, 1.0),
            "learning_rate_end": (0.0, 1.0),
            "epochs": (1, 1000),
            "minibatch_size": (1, 1_000_000),
            "max_grad_norm": (1e-6, 1e6),
        }
        for field in fields(self):
            low, high = ranges.get(field.name, (False, True))
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
        loss = self._loss(policy, model.critic(shape, self.central_critic).to(env.device)).to(env.device)
        optimizer = torch.optim.Adam(loss.parameters(), lr=self.learning_rate, eps=1e-5)

        def schedule(progress: float) -> dict[str, float]:
            rate = self.learning_rate * (1.0 + (self.learning_rate_end - 1.0) * progress)
            entropy = self.entropy_coeff + (self.entropy_coeff_end - self.entropy_coeff) * progress
            for group in optimizer.param_groups:
                group["lr"] = rate
            loss.entropy_coeff.fill_(entropy)
            return {"train/learning_rate": rate, "train/clip_range": self.clip_epsilon}

        buffer = TensorDictReplayBuffer(
            storage=LazyTensorStorage(frames_per_batch, device=env.device),
            sampler=SamplerWithoutReplacement(),
            batch_size=min(self.minibatch_size, frames_per_batch),
        )
        return Learner(
            policy=policy,
            explore=policy,
            loss=loss,
            loss_keys=("loss_objective", "loss_critic", "loss_entropy"),
            columns=_COLUMNS,
            optimizer=optimizer,
            max_grad_norm=self.max_grad_norm,
            prepare=lambda batch: _with_advantages(loss, batch),
            buffer=buffer,
            keeps_data=False,
            passes=self.epochs,
            schedule=schedule,
        )

    def _loss(self, policy: ProbabilisticActor, critic: torch.nn.Module) -> MAPPOLoss:
        loss_class = MAPPOLoss if self.central_critic else IPPOLoss
        loss = loss_class(
            policy,
            critic,
            clip_epsilon=self.clip_epsilon,
            entropy_coeff=self.entropy_coeff,
            critic_coeff=self.critic_coeff,
            value_norm=PopArtValueNorm(shape=1) if self.value_norm else None,
        )
        loss.set_keys(
            action=ACTION,
            sample_log_prob=LOG_PROB,
            value=VALUE,
            reward=REWARD,
            done="done",
            terminated="terminated",
            advantage=_ADVANTAGE,
            value_target=_VALUE_TARGET,
        )
        loss.make_value_estimator(gamma=self.gamma, lmbda=self.lmbda)
        return loss


def _with_advantages(loss: MAPPOLoss, batch: TensorDictBase) -> TensorDictBase:
    """Add advantages and value targets over time, then drop what the loss does not read; [B, T] -> [B T]."""
    with torch.no_grad():
        loss.value_estimator(batch, params=loss.critic_network_params, target_params=loss.target_critic_network_params)
    return batch.exclude("next", "info", LOGITS, VALUE).reshape(-1)
