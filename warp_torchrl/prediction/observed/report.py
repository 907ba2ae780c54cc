"""Report of a corrected prediction: numbers, a CSV of scores, lines of Markdown and a figure."""

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

from warp_torchrl.env.pictures.drawing import save_figure, sheet, style
from warp_torchrl.prediction.observed.correction import FORECASTS, SHARES, Corrected
from warp_torchrl.prediction.scores.probabilities import joined_reliability
from warp_torchrl.system import disk

FIGURE, SCORES = "observed.png", "observed.csv"
_SCORES = ("jaccard", "kappa", "growth_jaccard", "growth_sorensen", "brier", "crps", "area")
_QUANTITIES = {
    "pace": "rate of the head, of the given one",
    "rate": "factor on all rates",
    "wind_speed": "factor on the wind's speed",
    "bearing": "turn of the wind [degrees]",
    "moisture": "factor on the moisture of dead fuel",
}
_LEADS = (15.0, 30.0, 60.0, 150.0)
_OF_LEADS = ("growth_jaccard", "brier")


def observed_numbers(found: Corrected, cell_size: float) -> dict[str, Any]:
    """Return what was learned, and the scores of each observation's forecasts, as plain values."""
    hectare = cell_size**2 / 10_000.0
    rows = [
        {
            "minutes": step.minutes,
            "lead_minutes": step.lead,
            "kind": step.kind,
            "burned_ha": float(step.burned.sum()) * hectare,
            "held": step.held,
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
        "leads": _by_lead(found),
        "reliability": {name: [list(row) for row in table] for name, table in tables.items()},
    }


def _means(rows: Sequence[Mapping[str, Any]], name: str) -> dict[str, float]:
    """Return the mean scores of a forecast over the observations but the first, before which nothing was seen."""
    judged = rows[1:] or rows
    return {each: sum(row["forecasts"][name][each] for row in judged) / len(judged) for each in _SCORES}


def _by_lead(found: Corrected) -> list[dict[str, Any]]:
    """Return the mean scores of forecasts by lead, from an observation on."""
    each = [(step.lead, step.scores) for step in found.steps[1:]] + [
        (lead.minutes, lead.scores) for lead in found.leads
    ]
    rows = []
    for least, most in zip((0.0, *_LEADS), _LEADS, strict=False):
        here = [scores for minutes, scores in each if least < minutes <= most]
        if here:
            means = {
                name: {of: sum(getattr(scores[name], of) for scores in here) / len(here) for of in _OF_LEADS}
                for name in FORECASTS
            }
            rows.append({"over_minutes": least, "to_minutes": most, "count": len(here), "forecasts": means})
    return rows


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
        f"{100.0 * rows[-1]['held']:.0f} % of the last front is taken to be held.",
        "",
        "| hours | forecast | Jaccard | kappa | of the growth | Brier | CRPS [min] |",
        "|---|---|---|---|---|---|---|",
    ]
    for row in rows:
        lines += [_row(f"{row['minutes'] / 60.0:.2f}", name, row["forecasts"][name]) for name in FORECASTS]
    what = "mean but the first" if len(rows) > 1 else "mean"
    lines += [_row(what, name, numbers["means"][name]) for name in FORECASTS]
    return lines + _lead_lines(numbers["leads"])


def _lead_lines(rows: Sequence[Mapping[str, Any]]) -> list[str]:
    """Return lines of Markdown: the scores by lead."""
    if not rows:
        return []
    lines = ["", f"| lead [min], forecasts | score | {' | '.join(FORECASTS)} |", "|---|---|" + "---|" * len(FORECASTS)]
    for row in rows:
        lead = f"{row['over_minutes']:g} to {row['to_minutes']:g}, {row['count']}"
        for of, title in zip(_OF_LEADS, ("Jaccard of the growth", "Brier"), strict=True):
            values = " | ".join(f"{row['forecasts'][name][of]:.3f}" for name in FORECASTS)
            lines.append(f"| {lead} | {title} | {values} |")
    return lines


def _row(first: str, name: str, scores: Mapping[str, float]) -> str:
    return (
        f"| {first} | {name} | {scores['jaccard']:.3f} | {scores['kappa']:.3f} | {scores['growth_jaccard']:.3f} | "
        f"{scores['brier']:.3f} | {scores['crps']:.3g} |"
    )


def write_observed_figure(path: Path, numbers: Mapping[str, Any], title: str) -> None:
    """Draw the Brier score of each forecast, what was learned of the head's rate, and a reliability diagram.

    Raises:
        ImportError: If Matplotlib is not installed.
        OSError: If the write fails, with the path.
    """
    rows = numbers["observations"]
    hours = [row["minutes"] / 60.0 for row in rows]
    with disk.with_path(path), style():
        figure, axes = sheet([["brier", "pace", "reliability"]], (10.5, 3.6), title)
        for name in FORECASTS:
            axes["brier"].plot(hours, [row["forecasts"][name]["brier"] for row in rows], marker="o", label=name)
        axes["brier"].set(title="Brier score over the growth", xlabel="hours since the start", yscale="log")
        axes["brier"].legend()
        low, middle, high = ([row["posterior"]["pace"][at] for row in rows] for at in (0, 2, -1))
        axes["pace"].fill_between(hours, low, high, alpha=0.25, label="5 % to 95 %")
        axes["pace"].plot(hours, middle, marker="o", label="half")
        axes["pace"].axhline(1.0, color="grey", linewidth=0.8)
        axes["pace"].set(title="rate of the head, of the given one", xlabel="hours since the start")
        axes["pace"].legend()
        axes["reliability"].plot([0, 1], [0, 1], color="grey", linewidth=0.8)
        for name in ("free", "members", "corrected"):
            bins = [row for row in numbers["reliability"][name] if row[2]]
            axes["reliability"].plot([row[0] for row in bins], [row[1] for row in bins], marker="o", label=name)
        axes["reliability"].set(title="reliability", xlabel="burn probability", ylabel="share that burned")
        axes["reliability"].legend()
        save_figure(figure, path)
