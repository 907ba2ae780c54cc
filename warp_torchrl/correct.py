"""Records a scripted person who corrects a policy: ``python -m warp_torchrl.correct policy=RUN out=FOLDER``."""

import sys
from collections.abc import Sequence
from dataclasses import dataclass, fields
from pathlib import Path

import torch
import yaml
from tensordict import TensorDict

from warp_torchrl.commands.failure import DONE, fail
from warp_torchrl.config.construction import ConfigError, construct
from warp_torchrl.config.grammar import check_flags, check_overrides
from warp_torchrl.config.run_config import ENVIRONMENT, build_components
from warp_torchrl.config.saved_config import environment_record
from warp_torchrl.config.seeds import SEEDS, WORLDS, first_world_seed
from warp_torchrl.demonstrations.files import save
from warp_torchrl.demonstrations.recording import Mover, Recording
from warp_torchrl.demonstrations.scripted import Hands, Person
from warp_torchrl.env import WildfireEnv
from warp_torchrl.heuristics import HEURISTICS
from warp_torchrl.live.player import Found
from warp_torchrl.live.side import Side
from warp_torchrl.models import ACTION, ACTION_MASK
from warp_torchrl.runs.destination import check_free
from warp_torchrl.validation import check_fields

USAGE = (
    "python -m warp_torchrl.correct policy=NAME or FOLDER out=FOLDER [episodes=32] [acts=1000] [seed=0] "
    "[by=coordinated] [delay=1] [error=0.1] [threshold=0.5] [KEY=VALUE ...]"
)
_PERSON = 1  # number of the scripted person among those of a match


@dataclass(frozen=True, kw_only=True)
class Session:
    """What is recorded.

    Attributes:
        policy: A shipped policy, a run folder or a checkpoint folder; it must tell its probabilities, as baselines do
            not.
        out: New folder of the recordings.
        episodes: How many, of the first worlds of the training seed.
        acts: Acts of the person after which no further episode begins; None plays all.
        seed: Training seed whose worlds are played: no evaluation has them.
        overrides: Of the scenario of the policy's training, in the command line's grammar.

    Raises:
        ValueError: If a value is out of its range.
    """

    policy: str
    out: str
    episodes: int = 32
    acts: int | None = None
    seed: int = 0
    overrides: tuple[str, ...] = ()

    def __post_init__(self) -> None:
        check_fields(self, episodes=(1, WORLDS), acts=(1, 1_000_000_000), seed=(0, SEEDS))


@dataclass(frozen=True)
class Corrected:
    """What became of an episode.

    Attributes:
        recording: What was played with the person.
        saved: Share of the trees that stood at its end.
        saved_alone: The same of the policy without the person.
    """

    recording: Recording
    saved: float
    saved_alone: float


class Correction:
    """A policy on a scenario, and a scripted person who corrects it.

    Args:
        session: What is recorded.
        person: How they correct.

    Raises:
        ConfigError: If the policy is unknown, tells no probabilities or does not fit, or an override is wrong.
        CheckpointError: If a run folder holds no sound checkpoint.
    """

    def __init__(self, session: Session, person: Person) -> None:
        found = Found(session.policy)
        if found.checkpoint is None:
            raise ConfigError(f"policy must be a trained one, which tells how sure it is, got {session.policy}")
        config = found.config(session.overrides)
        parts = build_components(config, ENVIRONMENT)
        env = WildfireEnv(parts["world"], observation=parts["observation"], reward=parts["reward"])
        env.reset()
        self.session, self.person, self.scenario = session, person, str(config["scenario"])
        self.side = Side(env, found.player(env, 0), environment_record(config))
        self.baseline = HEURISTICS[person.by](env)

    def play(self, episode: int) -> Corrected:
        """Play an episode without the person and with them.

        Args:
            episode: Number of the world among those of the training seed.
        """
        side, seed = self.side, first_world_seed(self.session.seed) + episode
        alone = self._play(seed, None)
        saved = self._play(seed, Hands(self.person, seed))
        return Corrected(side.record(), saved, alone)

    def _play(self, seed: int, hands: Hands | None) -> float:
        """Return the share of trees that stands in the end."""
        side = self.side
        side.crew.leave(_PERSON)
        side.restart(seed)
        with torch.no_grad():
            while not side.ended:
                side.questions()
                if hands is not None:
                    self._correct(hands)
                side.step()
        return side.curves.saved[-1]

    def _correct(self, hands: Hands) -> None:
        side, before, chances = self.side, hands.agent, self.side.chances
        if chances is None:
            raise ConfigError(f"policy must tell how sure it is, got {self.session.policy}")
        act = hands.drive(chances, self._advice(), side.possible)
        if before != hands.agent:
            if before is not None:
                side.crew.hand_back(before, _PERSON)
            if hands.agent is not None:
                side.crew.take(hands.agent, _PERSON)
        if act is not None and hands.agent is not None:
            side.crew.press(hands.agent, _PERSON, act)

    def _advice(self) -> torch.Tensor:
        shown = TensorDict({ACTION_MASK: self.side.shown[ACTION_MASK]}, batch_size=[1])
        advice: torch.Tensor = self.baseline(shown)[ACTION][0]
        return advice


def table(rows: Sequence[tuple[int, int, int, float, float]], scenario: str) -> str:
    """Return a Markdown table of episodes: steps, acts of the person, corrections, saved with them and without."""
    steps, acts, corrections = (sum(row[at] for row in rows) for at in range(3))
    saved, alone = (100.0 * sum(row[at] for row in rows) / len(rows) for at in (3, 4))
    return "\n".join(
        [
            "| scenario | episodes | steps | acts | corrections | saved with the person % | without % |",
            "|---|---|---|---|---|---|---|",
            f"| {scenario} | {len(rows)} | {steps} | {acts} | {corrections} | {saved:.1f} | {alone:.1f} |",
        ]
    )


def main(arguments: Sequence[str] | None = None) -> int:
    """Record what the command line asks for, and return the exit code."""
    given = list(sys.argv[1:] if arguments is None else arguments)
    if any(each in ("-h", "--help") for each in given):
        print(f"{USAGE}\n\n{Session.__doc__}\n{Person.__doc__}")
        return DONE
    try:
        _record(*read([each for each in given if not each.startswith("debug=")]))
    except Exception as error:
        return fail(error, "debug=true" in given)[0]
    return DONE


def read(arguments: Sequence[str]) -> tuple[Session, Person]:
    """Return what a command line asks for.

    Raises:
        ConfigError: If a word is no ``key=value``, or a value does not fit.
    """
    check_flags(arguments)
    check_overrides(arguments)
    own = {kind: [each.name for each in fields(kind) if each.name != "overrides"] for kind in (Session, Person)}
    pairs = [each.partition("=")[::2] for each in arguments]
    rest = tuple(f"{key}={value}" for key, value in pairs if not any(key in names for names in own.values()))
    values = {kind: {key: _value(value) for key, value in pairs if key in names} for kind, names in own.items()}
    session = construct(Session, {**values[Session], "overrides": rest}, "")
    return session, construct(Person, values[Person], "")


def _value(text: str) -> object:
    """Return a value of the command's own keys, a plain one."""
    try:
        found = yaml.safe_load(text)
    except yaml.YAMLError:
        return text
    return found if isinstance(found, (int, float)) or found is None else text.strip("'\"")


def _record(session: Session, person: Person) -> None:
    out = Path(session.out)
    check_free(out, "out")
    correction = Correction(session, person)
    rows: list[tuple[int, int, int, float, float]] = []
    for episode in range(session.episodes):
        played = correction.play(episode)
        recording = played.recording
        save(recording, out)
        by_person, corrected = recording.by(Mover.PERSON), recording.corrected()
        numbers = len(recording.steps), int(by_person.sum()), int(corrected.sum())
        rows.append((*numbers, played.saved, played.saved_alone))
        if session.acts is not None and sum(row[1] for row in rows) >= session.acts:
            break
    print(table(rows, correction.scenario), flush=True)


if __name__ == "__main__":
    sys.exit(main())
