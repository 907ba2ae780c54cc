"""Canonicalise, network, restore: the modules of a sequence in canonical orientation."""

from collections.abc import Mapping

from tensordict import TensorDictBase
from tensordict.nn import ProbabilisticTensorDictSequential, TensorDictModuleBase, TensorDictSequential

from warp_torchrl.entries import Planes, TeamPlanes, Vector
from warp_torchrl.models.canonical.entries import Symmetries, orientation_of, place_of, targets, turned
from warp_torchrl.models.canonical.orientation import Orientation
from warp_torchrl.models.canonical.state import canonical_state
from warp_torchrl.models.signature import (
    ACTION_ONE_HOT,
    CANONICAL_ACTION_ONE_HOT,
    CANONICAL_STATE,
    ORIENTATION,
    SENT_ORIENTATION,
    STATE,
    Entry,
    Key,
    canonical_key,
    observation_key,
)


class Canonicalise(TensorDictModuleBase):
    """Turns each agent's observation, and writes its orientation, int64 [..., A].

    Args:
        observation: The entries, by name.
        is_late: Whether to turn what each observed when it sent what arrives now too, by its orientation then.

    Raises:
        ValueError: If an entry does not declare how it turns, or no entry shows a target.
    """

    def __init__(self, observation: Mapping[str, Entry], is_late: bool = False) -> None:
        super().__init__()
        self._symmetries = _declared(observation)
        times = {ORIENTATION: False, SENT_ORIENTATION: True} if is_late else {ORIENTATION: False}
        self._keys = {
            orientation: {name: (observation_key(name, sent), canonical_key(name, sent)) for name in observation}
            for orientation, sent in times.items()
        }
        self.in_keys = [read for keys in self._keys.values() for read, _ in keys.values()]
        self.out_keys = []
        for orientation, keys in self._keys.items():
            self.out_keys += [*(written for _, written in keys.values()), orientation]

    def forward(self, tensordict: TensorDictBase) -> TensorDictBase:
        """Write the entries in canonical orientation."""
        for written_at, keys in self._keys.items():
            entries = {name: tensordict.get(read) for name, (read, _) in keys.items()}
            orientation = orientation_of(entries, self._symmetries)
            for name, (_, written) in keys.items():
                tensordict.set(written, turned(entries[name], self._symmetries[name], orientation))
            tensordict.set(written_at, orientation.index)
        return tensordict


class CanonicaliseState(TensorDictModuleBase):
    """Turns the critic's state, see ``canonical_state``.

    Args:
        state: The entry.

    Raises:
        ValueError: If it does not declare how it turns.
    """

    def __init__(self, state: Entry) -> None:
        super().__init__()
        if not isinstance(state.symmetry, TeamPlanes):
            raise ValueError("model.symmetry must be none where the state does not say how it turns, got canonical")
        self._symmetry = state.symmetry
        self.in_keys, self.out_keys = [STATE], [CANONICAL_STATE]

    def forward(self, tensordict: TensorDictBase) -> TensorDictBase:
        """Write the state in canonical orientation."""
        return tensordict.set(CANONICAL_STATE, canonical_state(tensordict.get(STATE), self._symmetry))


class CanonicaliseAction(TensorDictModuleBase):
    """Turns actions that are given as one-hot vectors [..., A, actions].

    Args:
        actions: Their names.
    """

    def __init__(self, actions: tuple[str, ...]) -> None:
        super().__init__()
        self._actions = actions
        self.in_keys, self.out_keys = [ACTION_ONE_HOT, ORIENTATION], [CANONICAL_ACTION_ONE_HOT]

    def forward(self, tensordict: TensorDictBase) -> TensorDictBase:
        """Write the vectors in canonical orientation."""
        orientation = Orientation(tensordict.get(ORIENTATION))
        return tensordict.set(
            CANONICAL_ACTION_ONE_HOT, orientation.by_action(tensordict.get(ACTION_ONE_HOT), self._actions)
        )


class Restore(TensorDictModuleBase):
    """Turns entries with one number per action, [..., A, actions], back to the map's orientation.

    Args:
        key: Key of the entries.
        actions: Names of the actions.
    """

    def __init__(self, key: Key, actions: tuple[str, ...]) -> None:
        super().__init__()
        self._actions = actions
        self.in_keys, self.out_keys = [key, ORIENTATION], [key]

    def forward(self, tensordict: TensorDictBase) -> TensorDictBase:
        """Write the entries in the order of the map's actions."""
        key, orientation = self.out_keys[0], Orientation(tensordict.get(ORIENTATION))
        return tensordict.set(key, orientation.by_action_back(tensordict.get(key), self._actions))


def over_canonical(module: TensorDictModuleBase, restored: bool = False) -> TensorDictModuleBase:
    """Return the modules of a sequence that read canonical entries, the same objects, to learn from stored batches.

    Args:
        module: A sequence, or a part of one, which may begin with ``Canonicalise``; other modules are returned
            unchanged.
        restored: Whether it writes numbers in the order of the map's actions.
    """
    if not any(isinstance(each, (Canonicalise, CanonicaliseState)) for each in module.modules()):
        return module
    drops = (Canonicalise, CanonicaliseState) if restored else (Canonicalise, CanonicaliseState, Restore)
    parts = [over_canonical(each, restored) for each in module.module if not isinstance(each, drops)]
    if isinstance(module, ProbabilisticTensorDictSequential):
        return ProbabilisticTensorDictSequential(*parts)
    return parts[0] if len(parts) == 1 else TensorDictSequential(*parts)


def _declared(observation: Mapping[str, Entry]) -> Symmetries:
    """Return the symmetries that the entries declare, checked."""
    declared: dict[str, Planes | Vector] = {}
    for name, entry in observation.items():
        if not isinstance(entry.symmetry, (Planes, Vector)):
            raise ValueError(
                f"model.symmetry must be none where an entry does not say in its Space how it turns with the map, "
                f"as {name or 'the observation'} of shape {list(entry.shape)}, got canonical"
            )
        declared[name] = entry.symmetry
    found = [target for _, target, _ in targets(declared)]
    if not found:
        raise ValueError("model.symmetry must be none where no entry shows a target, such as fire, got canonical")
    if place_of(declared) is None and not all(target.in_middle for target in found):
        raise ValueError("model.symmetry must be none where no entry tells an agent's place, got canonical")
    return declared
