"""Trained policies for users: on TorchRL's tensordicts, and on the adapters' numpy observations."""

from collections.abc import Iterable, Mapping, Sequence
from contextlib import nullcontext
from typing import Any, cast

import numpy as np
import torch
from tensordict import TensorDict, TensorDictBase
from tensordict.nn import TensorDictModuleBase
from torch import Tensor
from torchrl.envs import EnvBase
from torchrl.envs.utils import ExplorationType, exploration_type, set_exploration_type

from warp_torchrl.models import (
    ACTION,
    ACTION_MASK,
    ACTION_VALUE,
    LOGITS,
    RADIO,
    Signature,
    recurrent_actors,
    signature,
)
from warp_torchrl.models.canonical import Canonicalise
from warp_torchrl.models.fitting import fitted
from warp_torchrl.models.networks import AgentNetworks
from warp_torchrl.runs.policies.inputs import AgentInputs, AgentObservation
from warp_torchrl.system.device import needs_no_sync
from warp_torchrl.system.finite import check_scores
from warp_torchrl.system.modes import apart
from warp_torchrl.world.state.state import Action

MODES = {"sampled": ExplorationType.RANDOM, "deterministic": ExplorationType.DETERMINISTIC}
"""TorchRL's exploration type of each mode."""


def scores(acted: TensorDictBase) -> Tensor | None:
    """Return the logits or values that chose the actions, float32 [..., actions]; None for other policies."""
    logits = acted.get(LOGITS, None)
    return acted.get(ACTION_VALUE, None) if logits is None else logits


class TrainedPolicy(TensorDictModuleBase):
    """A decentralised policy that acts in its mode, unless TorchRL's exploration type is set.

    Args:
        module: Reads observation and mask, writes the action.
        mode: ``sampled`` or ``deterministic``.
        trained: Inputs and outputs of its training.
        overrides: Give any environment the observation of the policy's training, except the critic's inputs:
            ``make_env("large", overrides=policy.overrides)``.
        shown: Signature of the environment in which it acts; None: that of its training.
    """

    def __init__(
        self,
        module: TensorDictModuleBase,
        mode: str,
        trained: Signature,
        overrides: Sequence[str] = (),
        shown: Signature | None = None,
    ) -> None:
        super().__init__()
        inner = {key for each in module.modules() if isinstance(each, Canonicalise) for key in each.out_keys}
        self.in_keys, self.out_keys = module.in_keys, [key for key in module.out_keys if key not in inner]
        self.module, self.mode, self.trained, self.overrides = module, mode, trained, tuple(overrides)
        self.shown = trained if shown is None else shown

    def fitted(self, env: EnvBase) -> "TrainedPolicy":
        """Return the policy adapted to an environment that may have more channels or actions than it was trained with.

        Raises:
            ValueError: If the environment lacks a channel or action of the policy; the message names it.
        """
        here = signature(env)
        if self.talks and RADIO not in env.full_observation_spec.keys(True, True):
            raise ValueError(
                "its agents talk by radio, which this environment does not have: mechanics.radio.carries=graph"
            )
        if self.talks and here.is_late and not self.trained.is_late:
            raise ValueError("its agents' messages come at once, and in this environment late: mechanics.radio.delay=0")
        if self.is_by_agent and here.n_agents != self.trained.n_agents:
            raise ValueError(
                f"it has a network for each of {self.trained.n_agents} agents, this team has {here.n_agents}"
            )
        module = fitted(self.module, self.trained, here, fallback=int(Action.EXTINGUISH))
        return TrainedPolicy(module, self.mode, self.trained, self.overrides, here)

    @property
    def is_by_agent(self) -> bool:
        """Return whether it has a network for each agent; then it fits one team size only."""
        return any(isinstance(module, AgentNetworks) for module in self.modules())

    @property
    def talks(self) -> bool:
        """Return whether its agents exchange messages."""
        return RADIO in self.in_keys

    @apart
    def forward(self, tensordict: TensorDictBase) -> TensorDictBase:
        """Write the team's actions, int64 [B, A].

        Raises:
            NumericalFailure: If what they were chosen by is not finite; a GPU is not asked.
        """
        own = set_exploration_type(MODES[self.mode]) if exploration_type() is None else nullcontext()
        with own:
            acted = self.module(tensordict.copy()).select(*self.out_keys, strict=False)
        if needs_no_sync(acted[ACTION].device):
            check_scores(scores(acted))
        return tensordict.update(acted)

    @apart
    def probabilities(self, acted: TensorDictBase) -> Tensor | None:
        """Return the probability of each action; None for a policy that acts by values.

        Args:
            acted: What ``forward`` returned, with the mask.

        Returns:
            float32 [B, A, actions], 0 where the mask is closed or the policy does not know the action.
        """
        logits = acted.get(LOGITS, None)
        if logits is None:
            return None
        mask, here = acted[ACTION_MASK], self.shown.actions
        scores = torch.full(mask.shape, -torch.inf, device=mask.device)
        scores[..., [here.index(name) for name in self.trained.actions]] = logits.float()
        return scores.masked_fill(~mask, -torch.inf).softmax(dim=-1).nan_to_num(0.0)

    def numpy_policy(self) -> "NumpyPolicy":
        """Return the policy for the adapters' numpy observations, called as ``act(observation, info)``."""
        return NumpyPolicy(self)


class NumpyPolicy:
    """A trained policy on the numpy observations of ``warp_torchrl.api.adapters``, in either layout.

    Each agent's action depends on its observation and mask only, so it takes one agent, a team, or a batch of worlds. A
    policy whose agents talk (``model.messages``) needs the whole team, in the order of ``possible_agents``, and infos,
    which hold each agent's radio, and its observation at the time of sending where messages arrive late. A policy with
    a network for each agent (``sharing: none``) needs the whole team likewise. A policy with a network for each role
    (``sharing: role``) reads the role from the agent's name (``bulldozer_0``), or from its ``status`` if it has no
    name; one with a network for each agency (``sharing: agency``) reads the agency from ``status``. A recurrent policy
    (``memory``) keeps a hidden state for each name; agents without names need a ``numpy_policy()`` each.

    Args:
        policy: Acts in its mode; sampled actions use torch's generator.
    """

    def __init__(self, policy: TrainedPolicy) -> None:
        self._policy, self._inputs = policy, AgentInputs(policy.in_keys, policy.shown)
        modules = policy.modules()
        self._n_agents = next((len(each.networks) for each in modules if isinstance(each, AgentNetworks)), None)
        self._recurrent = recurrent_actors(policy)
        self._memory: dict[str, Tensor] = {}  # float32 [B, M] of each agent
        self._device = next(policy.parameters()).device

    def __call__(
        self, observation: AgentObservation | Mapping[str, AgentObservation], info: Mapping[str, Any] | None = None
    ) -> int | np.ndarray | dict[str, Any]:
        """Choose actions.

        Args:
            observation: Of one agent, as in the Gymnasium adapter, or a dict by agent name, as in PettingZoo. A batch
                of worlds comes first, [B, ...].
            info: The same step's info. Preset ``paper`` needs it, whose mask is there unless the layout is flat, and
                policies whose agents talk, whose ``radio`` is there, and ``sent`` where messages come late.

        Returns:
            The agent's action, or a dict by agent name; int64 [B] for a batch of worlds.

        Raises:
            ValueError: If an entry is missing, or its shape or type differs from training, or the whole team or an
                agent's role is needed and missing.
        """
        alone = self._inputs.is_of_one(observation)
        team: Mapping[str, Any] = {"": observation} if alone else cast("Mapping[str, Any]", observation)
        infos = {"": info or {}} if alone else (info or {})
        if not team:
            return {}
        if self._n_agents not in (None, len(team)):
            raise ValueError(
                f"this policy has a network for each of {self._n_agents} agents: observations must be of all of them "
                f"at once, got {len(team)}"
            )
        agents = [self._inputs.of_agent(name, seen, infos.get(name, {})) for name, seen in team.items()]
        if self._policy.talks and agents[0][RADIO].shape[-2] != len(team):
            raise ValueError(
                f"this policy's agents talk: observations must be of the whole team of {agents[0][RADIO].shape[-2]} at "
                f"once, got {len(team)}"
            )
        actions = self._act(list(team), agents)
        numbers = [each if each.ndim else int(each) for each in actions]
        return numbers[0] if alone else dict(zip(team, numbers))

    @torch.no_grad()
    def _act(self, names: list[str], agents: list[dict[Any, np.ndarray]]) -> Iterable[np.ndarray]:
        """Return each agent's actions, int64 [] or [B]."""
        worlds = agents[0][ACTION_MASK].shape[:-1]
        stacked = {key: np.stack([each[key] for each in agents], axis=len(worlds)) for key in agents[0]}
        read = TensorDict({}, batch_size=worlds or (1,), device=self._device)
        for key, value in stacked.items():
            tensor = torch.from_numpy(value).to(self._device)
            read.set(key, tensor if worlds else tensor[None])
        for actor in self._recurrent:
            actor.remembered = self._recall(names, read.batch_size, actor.size[1])
        action = self._policy(read)[ACTION].numpy(force=True)
        for actor in self._recurrent:
            self._memory |= dict(zip(names, actor.remembered.unbind(-2), strict=True))
        return np.moveaxis(action if worlds else action[0], -1, 0)

    def _recall(self, names: list[str], worlds: Sequence[int], size: int) -> Tensor:
        """Return each agent's hidden state, float32 [B, A, M]; 0 if it has not acted in this batch of worlds."""
        nothing = torch.zeros(*worlds, size, device=self._device)
        known = [self._memory.get(name, nothing) for name in names]
        return torch.stack([each if each.shape == nothing.shape else nothing for each in known], dim=-2)
