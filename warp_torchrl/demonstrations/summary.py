"""Summaries of recordings: actions by mover, and forest saved."""

from collections.abc import Iterable
from pathlib import Path
from typing import NamedTuple

from warp_torchrl.demonstrations.recording import Mover, Recording
from warp_torchrl.system.foreign_text import plain_text

_LONGEST = 80  # characters of a cell


class Summary(NamedTuple):
    """Summary of a recording.

    Attributes:
        name: Of its folder.
        scenario: Its scenario.
        seed: Of the episode.
        policy: Which played, with people.
        steps: How many.
        acts: Actions of people.
        corrections: Those of them that the policy had not proposed.
        saved: Share of the initial trees that stand where it was left, in 0..1; None if nobody has counted them.
    """

    name: str
    scenario: str
    seed: int
    policy: str
    steps: int
    acts: int
    corrections: int
    saved: float | None


def summary(folder: Path, recording: Recording) -> Summary:
    """Return the summary of the recording in a folder."""
    return Summary(
        name=folder.name,
        scenario=recording.scenario,
        seed=recording.seed,
        policy=recording.policy,
        steps=len(recording.steps),
        acts=int(recording.by(Mover.PERSON).sum()),
        corrections=int(recording.corrected().sum()),
        saved=recording.saved,
    )


def recordings_table(summaries: Iterable[Summary]) -> str:
    """Return a Markdown table, a row for each recording."""
    lines = [
        "| recording | scenario | seed | policy | steps | acts of people | corrections | saved % |",
        "|---|---|---:|---|---:|---:|---:|---:|",
    ]
    for each in summaries:
        saved = "" if each.saved is None else f"{100 * each.saved:.1f}"
        cells = (each.name, each.scenario, each.seed, each.policy, each.steps, each.acts, each.corrections, saved)
        lines.append("| " + " | ".join(map(_cell, cells)) + " |")
    return "\n".join(lines)


def _cell(value: object) -> str:
    """Return a value as a cell of a Markdown table for a terminal: what others wrote can make no further cell."""
    return plain_text(str(value), _LONGEST).replace("|", "\\|")
