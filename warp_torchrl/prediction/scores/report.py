"""Report of a fire's scores: plain values, and a page of Markdown."""

import math
from collections.abc import Mapping
from dataclasses import asdict
from typing import Any

from warp_torchrl.prediction.scores.scoring import FireScores, ObservationScores

_HEADINGS = (
    *("hours", "seen [ha]", "forecast", "predicted [ha]", "5 to 95 % [ha]", "area", "Jaccard", "Sorensen", "kappa"),
    *("Jaccard of the growth", "F1 of the growth", "Brier", "CRPS [min]", "CRPS of the area [ha]"),
)
_SCORES = ("jaccard", "sorensen", "kappa", "growth_jaccard", "growth_sorensen", "brier")
_LATEST = 1e7  # minutes: what is later is at the end of all times


def score_numbers(found: FireScores, title: str) -> dict[str, Any]:
    """Return the scores as plain values; None stands for what is not known."""
    return _plain(
        {
            "title": title,
            "observations": [_observation(each) for each in found.observations],
            "at_area": {name: asdict(scores) for name, scores in found.at_area.items()},
            "brier": found.brier,
            "reliability": found.reliability,
            "arrival": None if found.arrival is None else asdict(found.arrival),
        }
    )


def score_lines(numbers: Mapping[str, Any]) -> list[str]:
    """Return lines of Markdown, from the values of ``score_numbers``."""
    lines = [f"# Scores: {numbers['title']}", "", f"| {' | '.join(_HEADINGS)} |", "|---" * len(_HEADINGS) + "|"]
    for row in numbers["observations"]:
        lines.append(f"| {' | '.join(prediction_cells(row))} |")
        lines.append(f"| {' | '.join(_persistence(row))} |")
    if numbers["at_area"]:
        lines += ["", "| at the area last seen | Jaccard | Sorensen |", "|---|---|---|"]
        lines += [
            f"| {name} | {each['jaccard_at_area']:.3f} | {each['sorensen_at_area']:.3f} |"
            for name, each in numbers["at_area"].items()
        ]
    lines += ["", f"Brier score over the whole fire at the last observation: {numbers['brier']:.3f}."]
    if numbers["arrival"] is not None:
        error = numbers["arrival"]
        lines += [
            "",
            f"Times of arrival, predicted minus observed: mean {error['bias']:+.1f} min, mean absolute "
            f"{error['mean_absolute']:.1f} min, root mean square {error['root_mean_square']:.1f} min.",
        ]
    return lines


def prediction_cells(row: Mapping[str, Any]) -> list[str]:
    """Return an observation's scores as the cells of a table."""
    scores, areas = row["forecast"], row["areas"]
    return [
        hours_of(row),
        f"{row['seen_ha']:,.0f}",
        "predicted",
        f"{row['predicted_ha']:,.0f}",
        "-" if areas is None else f"{areas['low']:,.0f} to {areas['high']:,.0f}",
        f"{100.0 * (scores['area'] - 1.0):+.0f} %",
        *(_cell(scores[name]) for name in _SCORES),
        "-" if scores["crps"] is None else f"{scores['crps']:.0f}",
        "-" if areas is None else f"{areas['crps']:,.0f}",
    ]


def _cell(value: float | None) -> str:
    return "-" if value is None else f"{value:.3f}"


def hours_of(row: Mapping[str, Any]) -> str:
    """Return when an observation was made, in words."""
    return "end" if row["minutes"] is None else f"{row['minutes'] / 60.0:.2f}"


def _persistence(row: Mapping[str, Any]) -> list[str]:
    scores = [f"{row['persistence'][name]:.3f}" for name in ("jaccard", "sorensen", "kappa")]
    return ["", "", "persistence", "", "", "", *scores, "0.000", "0.000", "1.000", "", ""]


def _observation(each: ObservationScores) -> dict[str, Any]:
    values = asdict(each)
    if each.areas is not None:
        values["areas"]["holds"] = each.areas.holds
    if each.minutes > _LATEST:
        values["minutes"] = None
    return values


def _plain(value: Any) -> Any:
    if isinstance(value, Mapping):
        return {key: _plain(each) for key, each in value.items()}
    if isinstance(value, list | tuple):
        return [_plain(each) for each in value]
    return None if isinstance(value, float) and not math.isfinite(value) else value
