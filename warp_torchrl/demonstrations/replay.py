"""Replay of a recording, step by step, compared with the recorded steps."""

from collections.abc import Iterable, Iterator

import torch
from tensordict import TensorDictBase
from torch import Tensor

from warp_torchrl.demonstrations.events import carry_out
from warp_torchrl.demonstrations.recording import Recording
from warp_torchrl.env import WildfireEnv
from warp_torchrl.models import ACTION, ACTION_MASK, OBSERVATION, REWARD, ROLE
from warp_torchrl.runs.config.components import build_components
from warp_torchrl.runs.config.construction import ENVIRONMENT
from warp_torchrl.runs.config.plain_values import plain
from warp_torchrl.runs.config.saved_config import restore
from warp_torchrl.system.checksummed import Unsound
from warp_torchrl.world.state.state import WorldState

_Key = str | tuple[str, ...]
_MOST_CELLS = 2**22


class Replay:
    """Plays a recording in a new environment.

    Args:
        recording: Recording to play.

    Raises:
        ConfigError: If its configuration does not fit this version.
        Unsound: If its map is too large to be replayed, or its agents or actions are not those of its configuration.
    """

    def __init__(self, recording: Recording) -> None:
        self.recording = recording
        parts = build_components(plain(restore(recording.environment)), ENVIRONMENT)
        height, width = parts["world"].size
        if height * width > _MOST_CELLS:
            raise Unsound(
                f"the recording's map has {height} x {width} cells, and at most {_MOST_CELLS} are played again"
            )
        self.env = WildfireEnv(
            parts["world"], observation=parts["observation"], reward=parts["reward"], seed=recording.seed
        )
        self._world = self.env.world
        for what, recorded, here in (
            ("agents", recording.agents, self.env.agent_names),
            ("actions", recording.actions, self.env.action_names),
        ):
            if recorded != tuple(here):
                raise Unsound(f"the recording's {what} are not those of its configuration, {', '.join(here)}")
        has_roles = ROLE in recording.steps.keys(include_nested=True)
        self._seen = (OBSERVATION, ACTION_MASK, *([ROLE] if has_roles else []))

    def states(self) -> Iterator[WorldState]:
        """Play, and yield the world at its start and after every step, batch size [1].

        Raises:
            Unsound: If an entry that was recorded is missing, or is another here.
        """
        for _ in self.shown():
            yield self.env.shared_state

    def shown(self) -> Iterator[TensorDictBase]:
        """Play, and yield the observations at the start and after every step, batch size [1].

        Raises:
            Unsound: If an entry that was recorded is missing, or is another here.
        """
        env, steps = self.env, self.recording.steps
        env.world = self._world  # a wind that was held may blow there
        env.set_seeds([self.recording.seed])
        shown = env.reset()
        yield shown
        for at in range(len(steps)):
            shown = self._after_events(at, shown)
            row = steps[at]
            self._check(at, row, shown, self._seen)
            shown = env.step(shown.set(ACTION, row[ACTION][None]))["next"]
            self._check(at, row["next"], shown, (REWARD, "done", "terminated", "truncated"))
            if at == len(steps) - 1:
                shown = self._after_events(len(steps), shown)
                self._check_saved()
            yield shown

    def check(self) -> WorldState:
        """Play all steps, and return the last world.

        Raises:
            Unsound: If an entry that was recorded is missing, or is another here.
        """
        *_, last = self.states()
        return last

    def _after_events(self, step: int, shown: TensorDictBase) -> TensorDictBase:
        for event in self.recording.events:
            if event.step == step:
                try:
                    shown = carry_out(self.env, event)
                except ValueError as error:
                    raise Unsound(f"an event of the recording cannot be: {error}") from None
        return shown

    def _check_saved(self) -> None:
        recorded, found = self.recording.saved, float(self.env.tree_counts.saved()[0])
        if recorded is not None and abs(recorded - found) > 1e-6:
            raise Unsound(f"the recording says that {recorded:.2%} was saved, this version plays {found:.2%}")

    def _check(
        self, step: int, recorded: TensorDictBase, shown: TensorDictBase, keys: tuple[str | tuple[str, ...], ...]
    ) -> None:
        for key in keys:
            wanted, found = _entries(recorded[key]), _entries(shown[key])
            what = key if isinstance(key, str) else key[-1]
            if wanted.keys() != found.keys():
                raise Unsound(f"the recording's {what} has other entries than this version's: {_listed(wanted)}")
            for name, value in wanted.items():
                if not _is_same(found[name][0], value):
                    differs = f"{name or what} differs"
                    raise Unsound(f"step {step} of the recording is not what this version plays: {differs}")


def _entries(value: TensorDictBase | Tensor) -> dict[str, Tensor]:
    """Return the entries of an observation by name, or one tensor under no name."""
    return dict(value.items()) if isinstance(value, TensorDictBase) else {"": value}


def _listed(entries: Iterable[str]) -> str:
    return ", ".join(name or "a single tensor" for name in entries)


def _is_same(found: Tensor, recorded: Tensor) -> bool:
    if found.shape != recorded.shape or found.dtype != recorded.dtype:
        return False
    # Floats of another processor may differ in their last digits.
    return torch.allclose(found, recorded) if recorded.is_floating_point() else torch.equal(found, recorded)
