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

from warp_torchrl.env.flat import FLAT, unflattened
from warp_torchrl.models import (
    ACTION,
    ACTION_MASK,
    ACTION_VALUE,
    AGENCY,
    LOGITS,
    OBSERVATION,
    RADIO,
    ROLE,
    SENT,
    Signature,
    recurrent_actors,
    signature,
)
from warp_torchrl.models.canonical import Canonicalise
from warp_torchrl.models.fitting import fitted
from warp_torchrl.models.networks import AgentNetworks
from warp_torchrl.models.signature import observation_key
from warp_torchrl.system.device import needs_no_sync
from warp_torchrl.system.finite import check_scores
from warp_torchrl.system.modes import apart
from warp_torchrl.world.state.role import ROLES
from warp_torchrl.world.state.state import Action

MODES = {"sampled": ExplorationType.RANDOM, "deterministic": ExplorationType.DETERMINISTIC}
"""TorchRL's exploration type of each mode."""
AgentObservation = np.ndarray | Mapping[str, np.ndarray]


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
        self._policy = policy
        modules = list(policy.modules())
        read = ("".join(key[len(OBSERVATION) :]) for key in policy.in_keys if key[: len(OBSERVATION)] == OBSERVATION)
        self._entries = {name: policy.shown.observation[name] for name in read}
        self._shapes = {name: (entry.shape, entry.dtype) for name, entry in self._entries.items()}
        self._n_agents = next((len(each.networks) for each in modules if isinstance(each, AgentNetworks)), None)
        self._is_late = any(key[: len(SENT)] == SENT for key in policy.in_keys)
        self._by_role, self._by_agency = ROLE in policy.in_keys, AGENCY in policy.in_keys
        self._role_index = {ROLES[role].name: at for at, role in enumerate(policy.shown.roles) if role in ROLES}
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
        alone = self._is_of_one(observation)
        team: Mapping[str, Any] = {"": observation} if alone else cast("Mapping[str, Any]", observation)
        infos = {"": info or {}} if alone else (info or {})
        if not team:
            return {}
        if self._n_agents not in (None, len(team)):
            raise ValueError(
                f"this policy has a network for each of {self._n_agents} agents: observations must be of all of them "
                f"at once, got {len(team)}"
            )
        agents = [self._of_agent(name, seen, infos.get(name, {})) for name, seen in team.items()]
        if self._policy.talks and agents[0][RADIO].shape[-2] != len(team):
            raise ValueError(
                f"this policy's agents talk: observations must be of the whole team of {agents[0][RADIO].shape[-2]} at "
                f"once, got {len(team)}"
            )
        actions = self._act(list(team), agents)
        numbers = [each if each.ndim else int(each) for each in actions]
        return numbers[0] if alone else dict(zip(team, numbers))

    def _is_of_one(self, observation: AgentObservation | Mapping[str, AgentObservation]) -> bool:
        """Return whether an observation is of one agent, not of a team."""
        if isinstance(observation, Mapping):
            return bool({FLAT, *self._entries} & observation.keys())
        if "" not in self._entries:
            raise ValueError(
                f"observation must be a dict of {', '.join(self._entries)}, got {type(observation).__name__}"
            )
        return True

    def _of_agent(self, name: str, seen: Any, info: Mapping[str, Any]) -> dict[Any, np.ndarray]:
        """Return the policy's inputs of one agent, by key."""
        who = f" of {name}" if name else ""
        is_flat = isinstance(seen, Mapping) and FLAT in seen
        if is_flat:
            seen = {**seen, **unflattened(np.asarray(seen[FLAT]), self._shapes, f"observation{who}")}
        entries = {**info, **seen} if is_flat or "" not in self._entries else {"": seen, **info}
        missing = [entry for entry in ("action_mask", *self._entries) if entry not in entries]
        if missing:
            where = "info" if "" in self._entries and not is_flat else "observation"
            raise ValueError(f"{where}{who} must have {', '.join(missing)}, got {', '.join(entries) or 'nothing'}")
        mask = np.asarray(entries["action_mask"], dtype=bool)
        read: dict[Any, np.ndarray] = {ACTION_MASK: mask}
        for entry, (shape, dtype, *_) in self._entries.items():
            value, expected = np.asarray(entries[entry]), (*mask.shape[:-1], *shape)
            if value.shape != expected or value.dtype != dtype:
                rule = f"{entry or 'observation'}{who} must be {dtype} of shape {list(expected)}"
                raise ValueError(f"{rule}, got {value.dtype} {list(value.shape)}")
            read[observation_key(entry)] = value
        if self._policy.talks:
            read |= self._of_radio(who, info)
        if self._by_role:
            read[ROLE] = np.full(mask.shape[:-1], self._role(name, entries.get("status")))
        if self._by_agency:
            read[AGENCY] = self._agency(entries.get("status"))
        return read

    def _of_radio(self, who: str, info: Mapping[str, Any]) -> dict[Any, np.ndarray]:
        """Return an agent's radio, and its observation at the time of sending if messages arrive late, by key."""
        missing = [name for name in ("radio", *(["sent"] if self._is_late else [])) if name not in info]
        if missing:
            what = ", ".join(missing)
            raise ValueError(f"info{who} must have {what}, since this policy's agents talk: give its infos too")
        read = {RADIO: np.asarray(info["radio"], dtype=np.float32)}
        if not self._is_late:
            return read
        sent = unflattened(np.asarray(info["sent"]), self._shapes, f"sent of info{who}")
        return {**read, **{observation_key(entry, sent=True): value for entry, value in sent.items()}}

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

    def _role(self, name: str, own: np.ndarray | None) -> int:
        """Return the index of an agent's role, from its name or else from its ``status``."""
        kind = name.rpartition("_")[0]
        if kind in self._role_index:
            return self._role_index[kind]
        if own is None:
            raise ValueError(
                f"this policy has a network for each role: observations must be in a dict by agent, such as "
                f"{{'{next(iter(self._role_index))}_0': ...}}, got {name or 'one without a name'}"
            )
        told = self._entries["status"].names
        columns = [told.index(f"role_{role}") for role in self._policy.shown.roles]
        return int(np.asarray(own)[..., columns].reshape(-1, len(columns))[0].argmax())

    def _agency(self, own: np.ndarray | None) -> np.ndarray:
        """Return the index of the agency that an agent serves, int64 [] or [B], from its ``status``."""
        if own is None:
            raise ValueError("this policy has a network for each agency: observations must have self, which tells it")
        told = self._entries["status"].names
        return np.asarray(own)[..., [told.index(name) for name in self._policy.shown.agencies]].argmax(-1)
