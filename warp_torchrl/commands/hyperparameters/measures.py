"""Results of a search's runs: forest saved by share of the training, and the objective."""

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
    for share in range(COMPARED_EVERY, reached + 1, COMPARED_EVERY):
        low, high = (share - COMPARED_EVERY) * total / 100, math.inf if share == 100 else share * total / 100
        within = [saved for frames, saved in rows if low < frames <= high and math.isfinite(saved)]
        if within:
            found[share] = sum(within) / len(within)
        elif found:
            found[share] = found[share - COMPARED_EVERY]
    return found


def saved_at_the_end(path: Path, total: int) -> float | None:
    """Return the mean of ``world/saved`` over the last fifth of a training; None where no episode ended in it."""
    last = [saved for frames, saved in _rows(path) if frames > VALUED_FROM * total / 100 and math.isfinite(saved)]
    return sum(last) / len(last) if last else None


def saved_in_evaluation(path: Path) -> float | None:
    """Return the mean share of the forest that an ``evaluation.json`` says; None where there is none."""
    try:
        found = read_json(path, LARGEST_EVALUATION)["metrics"]["saved"]["mean"]
    except (OSError, ValueError, KeyError, TypeError):
        return None
    return float(found) if type(found) in (int, float) and abs(found) <= _LARGEST_NUMBER else None


def _rows(path: Path) -> list[tuple[float, float]]:
    """Return frames and the forest saved of each row that is written to its end, NaN where no episode ended."""
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
            frames, saved = float(row["time/frames"]), float(row["world/saved"] or "nan")
        except StopIteration:
            return found
        except (KeyError, TypeError, ValueError, csv.Error):
            continue  # cut by a crash
        if math.isfinite(frames):
            found.append((frames, saved))
