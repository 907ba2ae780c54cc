"""Inputs of networks from observation and state: in canonical orientation or north up, at once or late."""

from collections.abc import Sequence
from typing import Any

from tensordict.nn import TensorDictModuleBase, TensorDictSequential

from warp_torchrl.entries import TIME_LEFT, Vector
from warp_torchrl.models.canonical import (
    CanonicalBatch,
    Canonicalise,
    CanonicaliseAction,
    CanonicaliseState,
    Restore,
)
from warp_torchrl.models.packing import Packings
from warp_torchrl.models.signature import (
    ACTION_ONE_HOT,
    ACTION_VALUE,
    CANONICAL_ACTION_ONE_HOT,
    CANONICAL_STATE,
    LOGITS,
    ORIENTATION,
    SENT_ORIENTATION,
    STATE,
    Entry,
    Key,
    Signature,
    canonical_key,
    observation_key,
)
from warp_torchrl.models.trust import Trust, trust_entries


class Inputs:
    """Keys that the networks of a team read, and the modules that write them.

    Args:
        signature: What they fit.
        is_canonical: Whether they read it in canonical orientation.
        is_late: Whether they read what was observed when messages were sent that arrive now.
    """

    def __init__(self, signature: Signature, is_canonical: bool, is_late: bool) -> None:
        self.signature, self.is_canonical, self.is_late = signature, is_canonical, is_late
        self.state_key = CANONICAL_STATE if is_canonical else STATE
        """Of the state."""
        self.action_key: Key = CANONICAL_ACTION_ONE_HOT if is_canonical else ACTION_ONE_HOT
        """Of the action that is judged."""

    def key(self, name: str, sent: bool = False) -> Key:
        """Return the key of an entry of the observation, present or at the time of sending."""
        return canonical_key(name, sent) if self.is_canonical else observation_key(name, sent)

    def turned(self, sent: bool = False) -> list[Key]:
        """Return the key of the inputs' orientation; none for inputs that are north up."""
        return [SENT_ORIENTATION if sent else ORIENTATION] if self.is_canonical else []

    def observed(self, names: Sequence[str], sent: bool = False) -> list[Key]:
        """Return the keys of entries and of their orientation."""
        return [*(self.key(name, sent) for name in names), *self.turned(sent)]

    def clock(self) -> tuple[Key, int] | None:
        """Return the key of the entry with the time left, and its index there; None without one."""
        found = self._telling([TIME_LEFT])
        return None if found is None else (found[0], found[1].index(TIME_LEFT))

    def _telling(self, wanted: Sequence[str]) -> tuple[Key, tuple[str, ...]] | None:
        """Return the key of the vector with all of some named numbers, and the names of its numbers, or None."""
        for name, entry in self.signature.observation.items():
            if isinstance(entry.symmetry, Vector) and set(wanted) <= set(entry.symmetry.names):
                return self.key(name), entry.symmetry.names
        return None

    def batch(self, state: bool, restored: bool, packed: bool) -> CanonicalBatch:
        """Return the module that prepares batches for learning.

        Args:
            state: Whether networks read the state.
            restored: Whether actions are in the order of the map.
            packed: Whether planes that the world cannot fill are dropped.
        """
        shape, packings = self.signature, self._packings() if packed else None
        if not self.is_canonical:
            return CanonicalBatch(None, packings=packings)
        return CanonicalBatch(
            Canonicalise(shape.observation, self.is_late),
            CanonicaliseState(shape.state) if state else None,
            () if restored else shape.actions,
            packings,
        )

    def _packings(self) -> Packings:
        observed, times = self.signature.observation, (False, True) if self.is_late else (False,)
        entries: dict[Any, Entry] = {self.key(name, sent): each for name, each in observed.items() for sent in times}
        return Packings({**entries, self.state_key: self.signature.state})

    def _trusting(self, trust: float) -> list[TensorDictModuleBase]:
        """Return the module that raises the logits of advised actions; none if the trust is 0.

        Raises:
            ValueError: If observations lack the advice or the rules.
        """
        if not trust:
            return []
        actions = self.signature.actions
        found = self._telling(trust_entries(actions))
        if found is None:
            raise ValueError(
                "model.trust must be 0 where agents are not advised and told the rules, observation.advice and "
                f"observation.rules, got {trust}"
            )
        return [Trust(*found, actions, trust)]

    def around(
        self, module: TensorDictModuleBase, state: bool, action: bool, sent: bool, trust: float
    ) -> TensorDictModuleBase:
        """Return a module after the module that makes its inputs, and before the one that restores actions' order.

        Args:
            module: Reads by these keys.
            state: Whether it reads the state.
            action: Whether it reads an action.
            sent: Whether it reads what was observed when messages were sent.
            trust: Of logits, see ``Trust``.
        """
        trusts = self._trusting(trust)
        if not self.is_canonical:
            return TensorDictSequential(module, *trusts) if trusts else module
        shape = self.signature
        before: list[TensorDictModuleBase] = [Canonicalise(shape.observation, sent)]
        before += [CanonicaliseState(shape.state)] if state else []
        before += [CanonicaliseAction(shape.actions)] if action else []
        of_actions = [key for key in module.out_keys if key in (LOGITS, ACTION_VALUE)]
        return TensorDictSequential(*before, module, *trusts, *(Restore(key, shape.actions) for key in of_actions))
