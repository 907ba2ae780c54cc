"""Batches in canonical orientation: their entries are turned once, when the policy acts."""

from dataclasses import dataclass

from tensordict import TensorDictBase
from tensordict.nn import TensorDictModuleBase

from warp_torchrl.models.canonical.orientation import Orientation
from warp_torchrl.models.packing import Packings
from warp_torchrl.models.signature import ACTION, ACTION_MASK, OBSERVATION, ORIENTATION, SENT, STATE, TEACHER_ACTION


@dataclass(frozen=True)
class CanonicalBatch:
    """Replaces observations by their canonical entries, packed where ``packings`` says so.

    Attributes:
        observation: ``Canonicalise``; None leaves batches unchanged, for networks that read maps north up.
        state: ``CanonicaliseState``, where networks read the state.
        actions: Names of the actions if actions and masks are turned too; empty if networks restore their outputs.
        packings: Packing of the entries; None leaves them whole.
    """

    observation: TensorDictModuleBase | None
    state: TensorDictModuleBase | None = None
    actions: tuple[str, ...] = ()
    packings: Packings | None = None

    def __call__(self, batch: TensorDictBase) -> TensorDictBase:
        """Return a batch [...] with canonical entries instead of observation and state, packed if there is a packing.

        Canonical entries that the policy wrote when it acted are kept; missing ones are made. Entries of its ``next``
        are not changed.
        """
        turned = batch if self.observation is None else self._turned(batch, self.observation)
        return turned if self.packings is None else self.packings(turned)

    def _turned(self, batch: TensorDictBase, canonicalise: TensorDictModuleBase) -> TensorDictBase:
        out, keys = batch.copy(), batch.keys(include_nested=True)
        if ORIENTATION not in keys:
            canonicalise(out)
        if self.state is not None:
            self.state(out)
        if self.actions:
            self._turn_actions(out)
        return out.exclude(OBSERVATION, SENT, STATE)

    def _turn_actions(self, batch: TensorDictBase) -> None:
        orientation, keys = Orientation(batch.get(ORIENTATION)), batch.keys(include_nested=True)
        for key in (ACTION, TEACHER_ACTION):
            if key in keys:
                batch.set(key, orientation.action(batch.get(key), self.actions))
        if ACTION_MASK in keys:
            batch.set(ACTION_MASK, orientation.by_action(batch.get(ACTION_MASK), self.actions))
