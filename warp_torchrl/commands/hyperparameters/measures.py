"""Results of a search's runs: their goal, as the forest saved, by share of the training, and the objective."""

import csv
import math
from pathlib import Path

from warp_torchrl.runs.destination import LARGEST_EVALUATION
from warp_torchrl.system.foreign import Foreign, read_bytes, read_json

COMPARED_EVERY = 5
"""Between two of the shares at which trials are compared [% of a training]."""
VALUED_FROM = 80
"""The mean over what comes after is the value of a training [%]."""
_LARGEST_NUMBER = 1e15
_LARGEST = 100_000_000  # bytes of a metrics.csv


def goal_by_share(path: Path, total: int, goal: str) -> dict[int, float]:
    """Return the mean of ``world/<goal>`` in each step of a training, by the share of the frames at its end [%].

    Shares are of ``total_frames``, so that trainings with batches of any size can be compared. A step in which no
    episode ended has the value of the one before; before the first there is none.

    Args:
        path: A ``metrics.csv``, which may be being written to, or not be there yet.
        total: Frames of the training.
        goal: Name of the metric.
    """
    rows = _rows(path, goal)
    reached = min(100, int(100 * max((frames for frames, _ in rows), default=0) / total))
    found: dict[int, float] = {}
    for share in range(COMPARED_EVERY, reached + 1, COMPARED_EVERY):
        low, high = (share - COMPARED_EVERY) * total / 100, math.inf if share == 100 else share * total / 100
        within = [value for frames, value in rows if low < frames <= high and math.isfinite(value)]
        if within:
            found[share] = sum(within) / len(within)
        elif found:
            found[share] = found[share - COMPARED_EVERY]
    return found


def goal_at_the_end(path: Path, total: int, goal: str) -> float | None:
    """Return the mean of ``world/<goal>`` over the last fifth of a training; None where no episode ended in it."""
    rows = _rows(path, goal)
    last = [value for frames, value in rows if frames > VALUED_FROM * total / 100 and math.isfinite(value)]
    return sum(last) / len(last) if last else None


def goal_in_evaluation(path: Path, goal: str) -> float | None:
    """Return the mean of a metric that an ``evaluation.json`` says; None where there is none."""
    try:
        found = read_json(path, LARGEST_EVALUATION)["metrics"][goal]["mean"]
    except (OSError, ValueError, KeyError, TypeError):
        return None
    return float(found) if type(found) in (int, float) and abs(found) <= _LARGEST_NUMBER else None


def _rows(path: Path, goal: str) -> list[tuple[float, float]]:
    """Return frames and the goal of each row that is written to its end, NaN where no episode ended."""
    try:
        text = read_bytes(path, _LARGEST).decode(errors="replace").replace("\0", "")
    except (OSError, Foreign):
        return []
    lines = text[: text.rfind("\n") + 1].splitlines()
    rows = csv.DictReader(lines)
    found: list[tuple[float, float]] = []
    while True:
        try:
            row = next(rows)
            frames, value = float(row["time/frames"]), float(row[f"world/{goal}"] or "nan")
        except StopIteration:
            return found
        except (KeyError, TypeError, ValueError, csv.Error):
            continue  # cut by a crash
        if math.isfinite(frames):
            found.append((frames, value))
