"""A recording played again, step by step, and held against what was recorded."""

from collections.abc import Iterator

import torch
from tensordict import TensorDictBase

from warp_torchrl.config.components import build_components
from warp_torchrl.config.compose import plain
from warp_torchrl.config.groups import ENVIRONMENT
from warp_torchrl.config.saved_config import restore
from warp_torchrl.demonstrations.events import carry_out
from warp_torchrl.demonstrations.recording import Recording
from warp_torchrl.env import WildfireEnv
from warp_torchrl.models import ACTION, ACTION_MASK, OBSERVATION, REWARD
from warp_torchrl.runs.sealed import Unsound
from warp_torchrl.world.state import WorldState

_Key = str | tuple[str, ...]


class Replay:
    """Plays a recording in an environment of its own.

    Args:
        recording: What was played.

    Raises:
        ConfigError: If its configuration is none of this version.
    """

    def __init__(self, recording: Recording) -> None:
        self.recording = recording
        parts = build_components(plain(restore(recording.environment)), ENVIRONMENT)
        self.env = WildfireEnv(
            parts["world"], observation=parts["observation"], reward=parts["reward"], seed=recording.seed
        )
        self._world = self.env.world

    def states(self) -> Iterator[WorldState]:
        """Play, and yield the world at its start and after every step, batch size [1].

        Raises:
            Unsound: If an agent sees, may do or earns other than was recorded.
        """
        for _ in self.shown():
            yield self.env.shared_state

    def shown(self) -> Iterator[TensorDictBase]:
        """Play, and yield what the environment shows at its start and after every step, batch size [1].

        Raises:
            Unsound: If an agent sees, may do or earns other than was recorded.
        """
        env, steps = self.env, self.recording.steps
        env.world = self._world  # a wind that was held may blow there
        env.set_seeds([self.recording.seed])
        shown = env.reset()
        yield shown
        for at in range(len(steps)):
            shown = self._after_events(at, shown)
            row = steps[at]
            self._check(at, row, shown, (OBSERVATION, ACTION_MASK))
            shown = env.step(shown.set(ACTION, row[ACTION][None]))["next"]
            self._check(at, row["next"], shown, (REWARD, "done"))
            if at == len(steps) - 1:
                shown = self._after_events(len(steps), shown)
                self._check_saved()
            yield shown

    def check(self) -> WorldState:
        """Play it all, and return the last world.

        Raises:
            Unsound: If an agent sees, may do or earns other than was recorded.
        """
        *_, last = self.states()
        return last

    def _after_events(self, step: int, shown: TensorDictBase) -> TensorDictBase:
        for event in self.recording.events:
            if event.step == step:
                shown = carry_out(self.env, event)
        return shown

    def _check_saved(self) -> None:
        recorded, found = self.recording.saved, float(self.env.tree_counts.saved()[0])
        if recorded is not None and abs(recorded - found) > 1e-6:
            raise Unsound(f"the recording says that {recorded:.2%} was saved, this version plays {found:.2%}")

    def _check(
        self, step: int, recorded: TensorDictBase, shown: TensorDictBase, keys: tuple[str | tuple[str, ...], ...]
    ) -> None:
        for key in keys:
            wanted = recorded[key]
            leaves = wanted.items(include_nested=True) if isinstance(wanted, TensorDictBase) else [("", wanted)]
            for name, value in leaves:
                found = (shown[key] if name == "" else shown[key][name])[0]
                # Floats of another processor may differ in their last digits.
                same = torch.allclose(found, value) if value.is_floating_point() else torch.equal(found, value)
                if not same:
                    what = name or (key if isinstance(key, str) else key[-1])
                    raise Unsound(f"step {step} of the recording is not what this version plays: {what} differs")
