"""Report of a corrected prediction: numbers, a CSV of scores, lines of Markdown and a figure."""

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

from warp_torchrl.env.pictures.drawing import save_figure, sheet, style
from warp_torchrl.prediction.observed.correction import FORECASTS, SHARES, Corrected
from warp_torchrl.prediction.observed.scores import joined_reliability
from warp_torchrl.system import disk

FIGURE, SCORES = "observed.png", "observed.csv"
_SCORES = ("jaccard", "kappa", "growth_jaccard", "brier", "crps", "area")
_QUANTITIES = {"rate": "factor on all rates", "wind_speed": "factor on the wind's speed", "bearing": "turn [degrees]"}


def observed_numbers(found: Corrected, cell_size: float) -> dict[str, Any]:
    """Return what was learned, and the scores of each observation's forecasts, as plain values."""
    hectare = cell_size**2 / 10_000.0
    rows = [
        {
            "minutes": step.minutes,
            "lead_minutes": step.lead,
            "kind": step.kind,
            "burned_ha": float(step.burned.sum()) * hectare,
            "effective_members": step.effective,
            "drawn": step.drawn,
            "forecasts": {
                name: {each: getattr(scores, each) for each in _SCORES} for name, scores in step.scores.items()
            },
            "posterior": {name: list(values) for name, values in step.posterior.items()},
        }
        for step in found.steps
    ]
    tables = {name: joined_reliability([step.scores[name].reliability for step in found.steps]) for name in FORECASTS}
    return {
        "members": len(found.members),
        "last_minutes": found.minutes,
        "quantiles": list(SHARES),
        "posterior": rows[-1]["posterior"],
        "observations": rows,
        "means": {name: _means(rows, name) for name in FORECASTS},
        "reliability": {name: [list(row) for row in table] for name, table in tables.items()},
    }


def _means(rows: Sequence[Mapping[str, Any]], name: str) -> dict[str, float]:
    """Return the mean scores of a forecast over the observations but the first, before which nothing was seen."""
    judged = rows[1:] or rows
    return {each: sum(row["forecasts"][name][each] for row in judged) / len(judged) for each in _SCORES}


def write_scores(path: Path, numbers: Mapping[str, Any]) -> None:
    """Write a row for each observation and forecast.

    Raises:
        OSError: If the write fails, with the path.
    """
    lines = [",".join(("minutes", "lead_minutes", "kind", "burned_ha", "forecast", *_SCORES))]
    for row in numbers["observations"]:
        for name, scores in row["forecasts"].items():
            first = f"{row['minutes']:.6g},{row['lead_minutes']:.6g},{row['kind']},{row['burned_ha']:.6g},{name}"
            lines.append(",".join((first, *(f"{scores[each]:.6g}" for each in _SCORES))))
    disk.replace(path, "\n".join(lines) + "\n")


def observed_lines(numbers: Mapping[str, Any]) -> list[str]:
    """Return lines of Markdown: the posterior, the scores of each observation, and their means."""
    rows = numbers["observations"]
    last = numbers["last_minutes"] / 60.0
    lines = [
        "## What was seen",
        "",
        f"{len(rows)} observations, {numbers['members']} members; maps, areas and times above are of the forecast "
        f"from the last one on, {last:.3g} hours after the start.",
        "",
        "| learned | 5 % | half | 95 % |",
        "|---|---|---|---|",
    ]
    for name, text in _QUANTITIES.items():
        values = numbers["posterior"][name]
        lines.append(f"| {text} | {values[0]:.3g} | {values[2]:.3g} | {values[-1]:.3g} |")
    lines += [
        "",
        "| hours | forecast | Jaccard | kappa | of the growth | Brier | CRPS [min] |",
        "|---|---|---|---|---|---|---|",
    ]
    for row in rows:
        lines += [_row(f"{row['minutes'] / 60.0:.2f}", name, row["forecasts"][name]) for name in FORECASTS]
    what = "mean but the first" if len(rows) > 1 else "mean"
    lines += [_row(what, name, numbers["means"][name]) for name in FORECASTS]
    return lines


def _row(first: str, name: str, scores: Mapping[str, float]) -> str:
    return (
        f"| {first} | {name} | {scores['jaccard']:.3f} | {scores['kappa']:.3f} | {scores['growth_jaccard']:.3f} | "
        f"{scores['brier']:.3f} | {scores['crps']:.3g} |"
    )


def write_observed_figure(path: Path, numbers: Mapping[str, Any], title: str) -> None:
    """Draw the Brier score of each forecast, what was learned of the rate, and a reliability diagram.

    Raises:
        ImportError: If Matplotlib is not installed.
        OSError: If the write fails, with the path.
    """
    rows = numbers["observations"]
    hours = [row["minutes"] / 60.0 for row in rows]
    with disk.with_path(path), style():
        figure, axes = sheet([["brier", "rate", "reliability"]], (10.5, 3.6), title)
        for name in FORECASTS:
            axes["brier"].plot(hours, [row["forecasts"][name]["brier"] for row in rows], marker="o", label=name)
        axes["brier"].set(title="Brier score over the growth", xlabel="hours since the start", yscale="log")
        axes["brier"].legend()
        low, middle, high = ([row["posterior"]["rate"][at] for row in rows] for at in (0, 2, -1))
        axes["rate"].fill_between(hours, low, high, alpha=0.25, label="5 % to 95 %")
        axes["rate"].plot(hours, middle, marker="o", label="half")
        axes["rate"].axhline(1.0, color="grey", linewidth=0.8)
        axes["rate"].set(title="factor on all rates", xlabel="hours since the start")
        axes["rate"].legend()
        axes["reliability"].plot([0, 1], [0, 1], color="grey", linewidth=0.8)
        for name in ("free", "members", "corrected"):
            bins = [row for row in numbers["reliability"][name] if row[2]]
            axes["reliability"].plot([row[0] for row in bins], [row[1] for row in bins], marker="o", label=name)
        axes["reliability"].set(title="reliability", xlabel="burn probability", ylabel="share that burned")
        axes["reliability"].legend()
        save_figure(figure, path)
