"""Report of a calibration: a table, and the law as a yaml that ``fire=`` takes."""

import json
from collections.abc import Mapping, Sequence
from dataclasses import MISSING, asdict, fields
from pathlib import Path
from typing import Any

import yaml

from warp_torchrl.prediction.scores.scar import Scores
from warp_torchrl.system import disk
from warp_torchrl.world.law.rate import RateFire

ScoreRows = Mapping[str, Mapping[str, Scores]]
"""Scores by fire and by what was scored."""
_COLUMNS = {
    "jaccard_at_area": "Jaccard at area",
    "sorensen_at_area": "Sorensen at area",
    "jaccard": "Jaccard at hour",
    "sorensen": "Sorensen at hour",
    "kappa": "kappa",
    "area_error": "area error",
    "brier": "Brier",
    "arrival_bias": "arrival bias [min]",
    "arrival_mae": "arrival MAE [min]",
    "arrival_error": "arrival RMSE [min]",
}


class ScoreLog:
    """Scores by fire and by what was scored; each is written as soon as it is known, a line of JSON.

    Args:
        path: The file, which is begun again.
        fires: Their names, in the order of the rows.
    """

    def __init__(self, path: Path, fires: Sequence[str]) -> None:
        self._path = path
        self.scores: dict[str, dict[str, Scores]] = {name: {} for name in fires}
        with disk.with_path(path):
            path.write_text("")

    def add(self, fire: str, model: str, scores: Scores) -> None:
        """Add the scores of a model on a fire."""
        self.scores[fire][model] = scores
        with disk.with_path(self._path), self._path.open("a") as file:
            file.write(json.dumps({"fire": fire, "model": model, **asdict(scores)}) + "\n")


def scores_table(rows: ScoreRows) -> str:
    """Return scores as a table in Markdown, a line for each fire and what was scored, their means at the end."""
    all_scores = [scores for by_model in rows.values() for scores in by_model.values()]
    shown = [name for name in _COLUMNS if any(getattr(scores, name) is not None for scores in all_scores)]
    lines = ["| fire | model | " + " | ".join(_COLUMNS[name] for name in shown) + " |", "|---" * (2 + len(shown)) + "|"]
    lines += [
        _line(fire, model, asdict(scores), shown) for fire, each in rows.items() for model, scores in each.items()
    ]
    if len(rows) > 1:
        lines += [_line("mean", model, mean, shown) for model, mean in means(rows).items()]
    return "\n".join(lines)


def means(rows: ScoreRows) -> dict[str, dict[str, float | None]]:
    """Return the mean of each score over the fires; of errors of the area, of how large they are."""
    models = list(dict.fromkeys(model for by_model in rows.values() for model in by_model))
    return {
        model: {
            name: _mean(name, [by_model[model] for by_model in rows.values() if model in by_model]) for name in _COLUMNS
        }
        for model in models
    }


def as_numbers(rows: ScoreRows) -> dict[str, Any]:
    """Return scores as plain values."""
    return {fire: {model: asdict(scores) for model, scores in each.items()} for fire, each in rows.items()}


def law_yaml(fire: RateFire, title: str) -> str:
    """Return a law as a file of ``conf/fire``: what differs from its defaults.

    Args:
        fire: The law.
        title: First line, a comment.
    """
    values: dict[str, Any] = {"_target_": f"{RateFire.__module__}.{RateFire.__name__}"}
    for each in fields(RateFire):
        default = each.default if each.default_factory is MISSING else each.default_factory()
        value = getattr(fire, each.name)
        if each.init and value != default:
            values[each.name] = _plain(value)
    return f"# {title}\n" + yaml.safe_dump(values, sort_keys=False)


def _plain(value: Any) -> Any:
    if isinstance(value, Mapping):
        return {key: _plain(each) for key, each in value.items()}
    if isinstance(value, tuple):
        return list(value)
    return float(f"{value:.6g}") if isinstance(value, float) else value


def _mean(name: str, all_scores: Sequence[Scores]) -> float | None:
    values = [getattr(scores, name) for scores in all_scores]
    known = [abs(value) if name == "area_error" else value for value in values if value is not None]
    return sum(known) / len(known) if known else None


def _line(fire: str, model: str, scores: Mapping[str, float | None], shown: Sequence[str]) -> str:
    return f"| {fire} | {model} | " + " | ".join(_cell(name, scores[name]) for name in shown) + " |"


def _cell(name: str, value: float | None) -> str:
    if value is None:
        return "-"
    if name == "area_error":
        return f"{100.0 * value:+.0f} %"
    return f"{value:.1f}" if name.startswith("arrival") else f"{value:.3f}"
