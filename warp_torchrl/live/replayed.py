"""A recording as a match: its side is played from the recording, and people watch."""

from collections.abc import Iterable
from dataclasses import replace
from typing import NoReturn

from tensordict import TensorDictBase
from torch import Tensor

from warp_torchrl.demonstrations.recording import Recording
from warp_torchrl.demonstrations.replay import Replay
from warp_torchrl.env import WildfireEnv
from warp_torchrl.heuristics import HEURISTICS
from warp_torchrl.live.crew import Crew, Question, Refused
from warp_torchrl.live.match import Match, Setting
from warp_torchrl.live.order import Order
from warp_torchrl.live.player import Player
from warp_torchrl.live.side import Side
from warp_torchrl.runs.config.components import build_components
from warp_torchrl.runs.config.construction import ENVIRONMENT
from warp_torchrl.runs.config.plain_values import plain
from warp_torchrl.runs.config.saved_config import restore
from warp_torchrl.system.checksummed import Unsound

_WATCHED = "a recording is watched as it was played: load a match to take part"


class ReplayedMatch(Match):
    """A recording, verified as it plays, and beside it the same fire without a team.

    Args:
        recording: What was played.
        setting: What may be loaded after it; its seed becomes the recording's.

    Raises:
        ConfigError: If its configuration is none of this version.
    """

    def __init__(self, recording: Recording, setting: Setting) -> None:
        self.recording = recording
        config = plain(restore(recording.environment))
        parts = build_components(config, ENVIRONMENT)
        self._set(replace(setting, seed=recording.seed), config, parts, [ReplayedSide(recording)])

    @property
    def ended(self) -> bool:
        """Return whether all of the recording was played."""
        return self.sides[0].ended

    def restart(self, seed: int | None = None) -> None:
        """Restart the recording.

        Raises:
            Refused: If the seed is another one.
        """
        if seed not in (None, self.recording.seed):
            raise Refused(f"the recording is of seed {self.recording.seed}: load a match to play another")
        super().restart()

    def step(self) -> list[str]:
        """Play the next step of the recording.

        Raises:
            Unsound: If it is not what this version plays.
        """
        if self.ended:
            return []
        at = len(self.sides[0].curves.saved) - 1
        self._carry_out(at)
        self.sides[0].step()
        self.alone.questions()
        told = self.alone.step()
        if self.ended:
            self._carry_out(at + 1)  # what people did after the last step
        return told

    def _carry_out(self, at: int) -> None:
        for event in self.recording.events:
            if event.step == at:
                self.alone.intervene(event.kind, *event.numbers)

    def blow(self, speed: float, direction: float) -> NoReturn:
        """Refuse it."""
        raise Refused(_WATCHED)

    def ignite(self, row: int, column: int) -> NoReturn:
        """Refuse it."""
        raise Refused(_WATCHED)

    def clear(self, row: int, column: int) -> NoReturn:
        """Refuse it."""
        raise Refused(_WATCHED)


class ReplayedSide(Side):
    """The team of a recording; nobody takes part.

    Args:
        recording: What was played.
    """

    def __init__(self, recording: Recording) -> None:
        self._replay = Replay(recording)
        super().__init__(self._replay.env, _Recorded(self._replay.env, recording), recording.environment)
        self.crew = _Spectators(self.world.team)
        self._count_of_steps = len(recording.steps)

    @property
    def ended(self) -> bool:
        """Return whether all of the recording was played, or it turned out to be another episode."""
        return self._is_broken or len(self.curves.saved) > self._count_of_steps

    def questions(self) -> list[Question]:
        """Return no question: the recording holds the answers."""
        return []

    def step(self) -> list[str]:
        """Play the next step.

        Raises:
            Unsound: If it is not what this version plays.
        """
        if self.ended:
            return []
        try:
            self.shown = next(self._steps)
        except Unsound:
            self._is_broken = True
            raise
        self._note()
        return []

    def order(self, agent: int, order: Order | None) -> NoReturn:
        """Refuse it."""
        raise Refused(_WATCHED)

    def ask_where_unsure(self, below: float | None) -> NoReturn:
        """Refuse it."""
        raise Refused(_WATCHED)

    def record(self) -> NoReturn:
        """Refuse it."""
        raise Refused("this is a recording already")

    def _reset(self, seed: int) -> TensorDictBase:
        self._steps, self._is_broken = self._replay.shown(), False
        return next(self._steps)


class _Spectators(Crew):
    """Seats that nobody takes."""

    def take(self, agent: int, person: int) -> NoReturn:
        raise Refused(_WATCHED)

    def hand_back(self, agent: int, person: int) -> NoReturn:
        raise Refused(_WATCHED)

    def press(self, agent: int, person: int, action: int) -> NoReturn:
        raise Refused(_WATCHED)

    def ask_before(self, actions: Iterable[str]) -> NoReturn:
        raise Refused(_WATCHED)


class _Recorded(Player):
    """The name of the recorded policy; it proposes nothing."""

    def __init__(self, env: WildfireEnv, recording: Recording) -> None:
        super().__init__(f"recorded: {recording.policy}", HEURISTICS["noop"](env), "sampled", recording.seed)
        self._frames = recording.frames

    @property
    def frames(self) -> int | None:
        return self._frames

    def act(self, shown: TensorDictBase) -> tuple[Tensor, Tensor | None]:
        raise Refused(_WATCHED)
