"""Deep Q-learning for teams, from TorchRL's losses: independent, or mixed into one value of the team (VDN, QMIX).

Mnih et al., "Human-level control through deep reinforcement learning", 2015; van Hasselt et al., "Deep Reinforcement
Learning with Double Q-learning", 2016; Sunehag et al., "Value-Decomposition Networks", 2018; Rashid et al., "QMIX",
2018.
"""

from dataclasses import dataclass
from typing import Literal

import torch
from tensordict.nn import TensorDictModule, TensorDictModuleBase, TensorDictSequential
from torchrl.modules import QMixer, QValueModule, VDNMixer
from torchrl.objectives import DQNLoss, LossModule, QMixerLoss, ValueEstimators

from warp_torchrl.algorithms.off_policy import AGENT_KEYS, TEAM_REWARD, EpsilonGreedy
from warp_torchrl.models import (
    ACTION,
    ACTION_MASK,
    ACTION_VALUE,
    CHOSEN_ACTION_VALUE,
    Mlp,
    Signature,
    over_canonical,
)

TEAM_VALUE = "chosen_action_value"


@dataclass(frozen=True, kw_only=True)
class Dqn(EpsilonGreedy):
    """Q-learning with epsilon-greedy exploration; in mode ``sampled`` an evaluated policy uses ``epsilon_end``.

    Attributes:
        mixer: ``none``: each agent learns its values from its reward (double DQN); ``vdn``: their sum is learned from
            the team's mean reward; ``qmix``: a monotonic network that reads the whole state mixes them.
        mixer_hidden: Width of QMIX's mixing layer.
        double_q: Whether the online network chooses the next action, which the target network judges (van Hasselt et
            al. 2016); else the target network does both. Only for ``mixer`` none.

    Raises:
        ValueError: If a value is out of its range, prioritised replay does not work here, or ``double_q`` is false
            beside a mixer.
    """

    updates: int = 128
    mixer: Literal["none", "vdn", "qmix"] = "none"
    mixer_hidden: int = 32
    double_q: bool = True

    def check(self, **ranges: tuple[float, float]) -> None:
        """Check the numbers against their ranges, and further fields against ``ranges``."""
        super().check(mixer_hidden=(1, 8192), **ranges)
        if self.mixer != "none" and not self.double_q:
            raise ValueError(f"double_q must be true where values are mixed, got false with mixer={self.mixer}")

    def check_model(self, model: Mlp) -> None:
        """Check the model as off-policy algorithms do, and that agents trust no adviser: actions have no probabilities.

        Raises:
            ValueError: If it cannot train the networks.
        """
        super().check_model(model)
        if model.trust:
            raise ValueError(f"trust must be 0 where actions have values and no chances, got {model.trust}")

    def policy(self, shape: Signature, model: Mlp) -> TensorDictSequential:
        """Return the team's decentralised epsilon-greedy policy."""
        return TensorDictSequential(*self._values(shape, model), self.epsilon_greedy(shape, self.epsilon_end))

    def _values(self, shape: Signature, model: Mlp) -> tuple[TensorDictModule, QValueModule]:
        choose = QValueModule(
            action_space="categorical",
            action_value_key=ACTION_VALUE,
            out_keys=[ACTION, ACTION_VALUE, CHOSEN_ACTION_VALUE],
            action_mask_key=ACTION_MASK,
        )
        return model.action_value(shape), choose

    def explorer(self, policy: TensorDictModuleBase, shape: Signature) -> TensorDictSequential:
        """Return the policy with a decreasing epsilon."""
        return TensorDictSequential(*policy.module[:-1], self.epsilon_greedy(shape, self.epsilon))

    def loss(self, policy: TensorDictModuleBase, shape: Signature, model: Mlp, device: torch.device) -> LossModule:
        """Return TorchRL's loss with its value estimator."""
        values = over_canonical(TensorDictSequential(*policy.module[:-1]), restored=True)
        if self.mixer == "none":
            loss = DQNLoss(
                values,
                action_space="categorical",
                delay_value=True,
                double_dqn=self.double_q,
                loss_function="smooth_l1",
            )
            loss.set_keys(action=ACTION, action_value=ACTION_VALUE, value=CHOSEN_ACTION_VALUE, **AGENT_KEYS)
        else:
            loss = QMixerLoss(
                values, self._mixer(shape, model, device), action_space="categorical", loss_function="smooth_l1"
            )
            loss.set_keys(
                action=ACTION,
                action_value=ACTION_VALUE,
                local_value=CHOSEN_ACTION_VALUE,
                global_value=TEAM_VALUE,
                reward=TEAM_REWARD,
            )
        loss.make_value_estimator(ValueEstimators.TD0, gamma=self.gamma)
        return loss

    def _mixer(self, shape: Signature, model: Mlp, device: torch.device) -> TensorDictModule:
        if self.mixer == "vdn":
            return TensorDictModule(
                VDNMixer(n_agents=shape.n_agents, device=device), in_keys=[CHOSEN_ACTION_VALUE], out_keys=[TEAM_VALUE]
            )
        mixer = QMixer(shape.state.shape, self.mixer_hidden, shape.n_agents, device)
        return TensorDictModule(mixer, in_keys=[CHOSEN_ACTION_VALUE, model.state_key], out_keys=[TEAM_VALUE])
