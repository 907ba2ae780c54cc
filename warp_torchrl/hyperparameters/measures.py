"""What a search reads in a run folder: how much forest was saved by which share of a training, and what it is worth."""

import csv
import json
import math
from pathlib import Path

STEP = 5
"""Between two of the shares at which trials are compared [% of a training]."""
LAST = 80
"""The mean over what comes after is the value of a training [%]."""


def saved_by_share(path: Path, total: int) -> dict[int, float]:
    """Return the mean of ``world/saved`` in each step of a training, by the share of the frames at its end [%].

    Shares are of ``total_frames``, so that trainings with batches of any size can be compared. A step in which no
    episode ended has the value of the one before; before the first there is none.

    Args:
        path: A ``metrics.csv``, which may be being written to, or not be there yet.
        total: Frames of the training.
    """
    rows = _rows(path)
    reached = min(100, int(100 * max((frames for frames, _ in rows), default=0) / total))
    found: dict[int, float] = {}
    for share in range(STEP, reached + 1, STEP):
        low, high = (share - STEP) * total / 100, math.inf if share == 100 else share * total / 100
        within = [saved for frames, saved in rows if low < frames <= high and math.isfinite(saved)]
        if within:
            found[share] = sum(within) / len(within)
        elif found:
            found[share] = found[share - STEP]
    return found


def saved_at_the_end(path: Path, total: int) -> float | None:
    """Return the mean of ``world/saved`` over the last fifth of a training; None where no episode ended in it."""
    last = [saved for frames, saved in _rows(path) if frames > LAST * total / 100 and math.isfinite(saved)]
    return sum(last) / len(last) if last else None


def saved_in_evaluation(path: Path) -> float | None:
    """Return the mean share of the forest that an ``evaluation.json`` says; None where there is none."""
    try:
        found = json.loads(path.read_text(encoding="utf-8"))["metrics"]["saved"]["mean"]
    except (OSError, ValueError, KeyError, TypeError):
        return None
    return float(found) if isinstance(found, int | float) and math.isfinite(found) else None


def _rows(path: Path) -> list[tuple[float, float]]:
    """Return frames and the forest saved of each row that is written to its end, NaN where no episode ended."""
    try:
        text = path.read_text(encoding="utf-8", errors="replace")
    except OSError:
        return []
    lines = text[: text.rfind("\n") + 1].splitlines()
    found = []
    for row in csv.DictReader(lines):
        try:
            found.append((float(row["time/frames"]), float(row["world/saved"] or "nan")))
        except (KeyError, TypeError, ValueError):
            continue  # cut by a crash
    return found
