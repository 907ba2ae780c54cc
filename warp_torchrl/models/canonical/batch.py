"""What is learnt from: a collected batch whose entries are turned once, when it was acted on."""

from dataclasses import dataclass

from tensordict import TensorDictBase
from tensordict.nn import TensorDictModuleBase

from warp_torchrl.models.canonical.orientation import Orientation
from warp_torchrl.models.packing import Packings
from warp_torchrl.models.signature import ACTION, ACTION_MASK, OBSERVATION, ORIENTATION, SENT, STATE, TEACHER_ACTION


@dataclass(frozen=True)
class CanonicalBatch:
    """Replaces what was observed by its canonical entries, packed where that is asked for.

    Attributes:
        observation: ``Canonicalise``; None where networks read maps as they are, which leaves batches as they are.
        state: ``CanonicaliseState``, where networks read the state.
        actions: Names of the actions where actions and masks are turned too; none where networks restore what they
            write.
        packings: What packs the entries; None leaves them whole.
    """

    observation: TensorDictModuleBase | None
    state: TensorDictModuleBase | None = None
    actions: tuple[str, ...] = ()
    packings: Packings | None = None

    def __call__(self, batch: TensorDictBase) -> TensorDictBase:
        """Return a batch [...] without observation and state, with their canonical entries; or packed as it is.

        The entries that the policy wrote when it acted are kept; those of a batch without them are made. Entries of
        its ``next`` stay as they are.
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
