"""Scores of probabilities of burning, and of ensembles of areas.

F(x, t) is the share of the fires that reach cell x by time t, o(x, t) is 1 where the fire has. Divided by the number of
cells that burned, the Brier score of a map on which nothing burns is 1, whatever the fire's size:

    Brier = sum (F - o)^2 / sum o                        (Brier 1950)
    CRPS  = sum of the integral of (F - o)^2 dt / sum o  (Matheson and Winkler 1976) [minutes]
"""

from collections.abc import Sequence

import torch
from torch import Tensor

BINS = 10
"""Of a reliability table."""
Reliability = tuple[tuple[float, float, int], ...]
"""Mean probability, share that burned and number of cells of each bin."""
_ENDS = (0.05, 0.95)


def brier(chance: Tensor, burned: Tensor, among: Tensor | None = None) -> Tensor:
    """Return the Brier score, float32 [...].

    Args:
        chance: F, float32 [..., H, W].
        burned: o, bool [..., H, W].
        among: The cells of the sum, bool [H, W]; None is all.
    """
    off = (chance - burned.to(torch.float32)).square()
    off = off if among is None else off * among
    return off.sum((-2, -1)) / burned.sum((-2, -1)).clamp(min=1)


def arrival_crps(reached: Tensor, arrival: Tensor, minutes: float, among: Tensor) -> float:
    """Return the CRPS of times of arrival over the cells that burned [minutes].

    Args:
        reached: F at the ends of S equal steps, float32 [S, H, W].
        arrival: When each cell burned, float32 [H, W] [minutes]; past the last step where it did not.
        minutes: How long the steps last in all.
        among: The cells of the sum, bool [H, W].
    """
    steps = torch.arange(1, len(reached) + 1) * (minutes / len(reached))
    happened = arrival <= steps[:, None, None]
    off = ((reached - happened.to(torch.float32)).square() * among).flatten(1).sum(1)
    return float(off.mean()) * minutes / max(1, int((happened[-1] & among).sum()))


def crps(values: Tensor, truth: float) -> float:
    """Return the CRPS of an ensemble, E|X - y| - E|X - X'| / 2 (Gneiting and Raftery 2007), in the unit of its values.

    Args:
        values: Of its members, float [n].
        truth: y.
    """
    values = values.double()
    apart = (values[:, None] - values).abs().mean()
    return float((values - truth).abs().mean() - apart / 2.0)


def interval(values: Tensor) -> tuple[float, float]:
    """Return the quantiles 5 % and 95 % of an ensemble's values, float [n]."""
    low, high = values.double().quantile(torch.tensor(_ENDS, dtype=torch.float64)).tolist()
    return low, high


def reliability(chance: Tensor, burned: Tensor) -> Reliability:
    """Return mean probability, share that burned and cells of each bin of probabilities (Murphy and Winkler 1977).

    Cells of probability 0 that did not burn are left out: a larger map would have more of them.

    Args:
        chance: float32 [n].
        burned: bool [n].
    """
    counted = (chance > 0.0) | burned
    chance, burned = chance[counted].double(), burned[counted]
    place = (chance * BINS).long().clamp(max=BINS - 1)
    count = torch.bincount(place, minlength=BINS)
    sums = [torch.bincount(place, each, BINS) / count.clamp(min=1) for each in (chance, burned.double())]
    return tuple(zip(sums[0].tolist(), sums[1].tolist(), count.tolist(), strict=True))


def joined_reliability(tables: Sequence[Reliability]) -> Reliability:
    """Return the reliability table of several forecasts together."""
    found = []
    for rows in zip(*tables, strict=True):
        cells = sum(row[2] for row in rows)
        found.append((*(sum(row[at] * row[2] for row in rows) / max(1, cells) for at in (0, 1)), cells))
    return tuple(found)  # type: ignore[arg-type]
