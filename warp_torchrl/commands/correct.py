"""The command correct: a scripted person corrects a policy, and both are recorded."""

from collections.abc import Sequence
from dataclasses import fields
from pathlib import Path

from warp_torchrl.commands.correction import Correction, Session
from warp_torchrl.commands.program import command_help, run_program
from warp_torchrl.demonstrations.files import save_recording
from warp_torchrl.demonstrations.scripted import Person
from warp_torchrl.demonstrations.summary import Summary, summary
from warp_torchrl.runs.config.construction import ConfigError, construct
from warp_torchrl.runs.config.grammar import own_values
from warp_torchrl.runs.output import remove_if_empty
from warp_torchrl.system import disk
from warp_torchrl.system.lock import RunFolderLock

USAGE = (
    "warp correct policy=NAME or FOLDER out=FOLDER [episodes=32] [acts=1000] [seed=0] "
    "[by=coordinated] [delay=1] [error=0.1] [threshold=0.5] [KEY=VALUE ...]"
)
_TEXTS = ("policy", "out", "by")


def main(arguments: Sequence[str] | None = None) -> int:
    """Record the corrections that the command line names, and return the exit code."""
    about = command_help(USAGE, Session, Person)
    return run_program(arguments, about, lambda given: _record(*read_session(given)))


def read_session(arguments: Sequence[str]) -> tuple[Session, Person]:
    """Return the session and the person of a command line.

    Raises:
        ConfigError: If a word is no ``key=value``, or a value does not fit.
    """
    session, person = ([each.name for each in fields(kind) if each.name != "overrides"] for kind in (Session, Person))
    values, rest = own_values(arguments, (*session, *person, "debug"), _TEXTS)
    parts = [{key: value for key, value in values.items() if key in names} for names in (session, person)]
    return construct(Session, {**parts[0], "overrides": rest}, ""), construct(Person, parts[1], "")


def _record(session: Session, person: Person) -> None:
    out, is_new = Path(session.out), not Path(session.out).exists()
    if out.is_dir() and any(each.name != ".lock" for each in out.iterdir()):
        raise ConfigError(f"out must be a new folder, {out} holds files")
    with disk.with_path(out):
        lock = RunFolderLock(out)  # before anything is played, so that nobody plays for nothing
    rows = []
    try:
        correction = Correction(session, person)
        for played in correction.episodes():
            rows.append((summary(save_recording(played.recording, out), played.recording), played.saved_alone))
    finally:
        if is_new and not rows:
            remove_if_empty(out)
        lock.release()
    print(correction_table(rows, correction.scenario), flush=True)


def correction_table(rows: Sequence[tuple[Summary, float]], scenario: str) -> str:
    """Return a Markdown table of episodes in all, and the forest that was saved with the person and without."""
    found = [each for each, _ in rows]
    steps, acts, corrections = (sum(each) for each in zip(*((one.steps, one.acts, one.corrections) for one in found)))
    saved = 100.0 * sum(each.saved or 0.0 for each in found) / len(found)
    alone = 100.0 * sum(each for _, each in rows) / len(rows)
    return "\n".join(
        [
            "| scenario | episodes | steps | acts | corrections | saved with the person % | without % |",
            "|---|---|---|---|---|---|---|",
            f"| {scenario} | {len(rows)} | {steps} | {acts} | {corrections} | {saved:.1f} | {alone:.1f} |",
        ]
    )
