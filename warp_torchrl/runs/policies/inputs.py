"""Observations of the adapters, as numpy arrays, checked and named as a policy reads them."""

from collections.abc import Iterable, Mapping
from typing import Any

import numpy as np

from warp_torchrl.env.flat import FLAT, unflattened
from warp_torchrl.models import ACTION_MASK, AGENCY, OBSERVATION, RADIO, ROLE, SENT, Signature
from warp_torchrl.models.signature import observation_key
from warp_torchrl.world.state.role import ROLES

AgentObservation = np.ndarray | Mapping[str, np.ndarray]


class AgentInputs:
    """What a policy reads of one agent, from its numpy observation and info, in either layout.

    Args:
        keys: The policy's inputs.
        shown: Signature of the environment in which it acts.
    """

    def __init__(self, keys: Iterable[Any], shown: Signature) -> None:
        keys, self._shown = list(keys), shown
        read = ("".join(key[len(OBSERVATION) :]) for key in keys if key[: len(OBSERVATION)] == OBSERVATION)
        self._entries = {name: shown.observation[name] for name in read}
        self._shapes = {name: (entry.shape, entry.dtype) for name, entry in self._entries.items()}
        self._is_late = any(key[: len(SENT)] == SENT for key in keys)
        self._by_role, self._by_agency, self.talks = ROLE in keys, AGENCY in keys, RADIO in keys
        self._role_index = {ROLES[role].name: at for at, role in enumerate(shown.roles) if role in ROLES}

    def is_of_one(self, observation: AgentObservation | Mapping[str, AgentObservation]) -> bool:
        """Return whether an observation is of one agent, not of a team.

        Raises:
            ValueError: If it is no dict, and the policy reads several entries.
        """
        if isinstance(observation, Mapping):
            return bool({FLAT, *self._entries} & observation.keys())
        if "" not in self._entries:
            raise ValueError(
                f"observation must be a dict of {', '.join(self._entries)}, got {type(observation).__name__}"
            )
        return True

    def of_agent(self, name: str, seen: Any, info: Mapping[str, Any]) -> dict[Any, np.ndarray]:
        """Return the policy's inputs of one agent, by key: as the observation, [...] or of a batch of worlds [B, ...].

        Args:
            name: Of the agent, or nothing.
            seen: Its observation.
            info: The same step's info.

        Raises:
            ValueError: If an entry is missing, or its shape or type differs from training.
        """
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
        if self.talks:
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
        columns = [told.index(f"role_{role}") for role in self._shown.roles]
        return int(np.asarray(own)[..., columns].reshape(-1, len(columns))[0].argmax())

    def _agency(self, own: np.ndarray | None) -> np.ndarray:
        """Return the index of the agency that an agent serves, int64 [] or [B], from its ``status``."""
        if own is None:
            raise ValueError("this policy has a network for each agency: observations must have self, which tells it")
        told = self._entries["status"].names
        return np.asarray(own)[..., [told.index(name) for name in self._shown.agencies]].argmax(-1)
