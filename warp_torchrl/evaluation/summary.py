"""Summary of runs: one table and one figure from their ``evaluation.json`` files.

A sweep writes both at its end; ``warp summary FOLDER ...`` makes them for any runs.
"""

import json
import math
import signal
from collections.abc import Callable, Mapping, Sequence
from functools import partial
from pathlib import Path
from textwrap import fill
from typing import Any

import numpy as np

from warp_torchrl.env.pictures.drawing import line_style
from warp_torchrl.evaluation.exports import draw_curves, marl_eval, rliable
from warp_torchrl.evaluation.report import LEGEND, MEANING
from warp_torchrl.evaluation.rows import SummaryRow, read_rows
from warp_torchrl.evaluation.statistics import compare, performance_profile, summarise
from warp_torchrl.evaluation.units import FORMS, headed, in_words, sign_of, written
from warp_torchrl.system import disk
from warp_torchrl.system.flags import FlagParser
from warp_torchrl.system.foreign_text import plain_text
from warp_torchrl.system.signals import exit_on_signal
from warp_torchrl.validation import did_you_mean
from warp_torchrl.world.mechanics.mechanic import Metric

LEVELS = np.linspace(0.0, 1.0, 101)
WORDS = (
    f"In the tables, {' '.join(LEGEND)}; 95 %: bootstrap interval of the number before; to POLICY: difference on the "
    "same fires; better on: share of these fires. Metrics for show, among others: "
    + "; ".join(f"{name}: {meaning}" for name, meaning in MEANING.items())
    + "."
)
"""What the words of the tables mean."""


def summary_table(entries: Sequence[SummaryRow], against: str | None = None) -> str:
    """Return a Markdown table of the entries, best first in each scenario, each compared with one policy.

    Scenarios where policies are compared by something else than the trees saved have a table of their own.

    Args:
        entries: Policies on scenarios.
        against: The policy to compare with; by default, or if a scenario lacks it, the best one.

    Raises:
        ValueError: If no scenario has the policy to compare with.
    """
    known = list(dict.fromkeys(entry.policy for entry in entries))
    if against not in (None, *known):
        raise ValueError(f"against must be one of {', '.join(known)}, got {against}{did_you_mean(against, known)}")
    goals = sorted({entry.goal for entry in entries}, key=lambda goal: (goal.name != "saved", goal))
    return "\n\n".join(_table(goal, [entry for entry in entries if entry.goal == goal], against) for goal in goals)


def _table(goal: Metric, entries: Sequence[SummaryRow], against: str | None) -> str:
    """Return the table of the scenarios of one goal."""
    lines = [
        f"| scenario | policy | runs | fires | {headed(goal, goal.name)} | 95 % | {headed(goal, 'iqm')} | success % "
        f"| to {against or 'the best'} | 95 % "
        "| better on |",
        "|---|---|---|---|---|---|---|---|---|---|---|",
    ]
    for group in _by_scenario(entries):
        other = next((entry for entry in group if entry.policy == against), group[0])
        for entry in group:
            found = summarise(entry.value)
            cells = [
                entry.scenario,
                entry.policy,
                str(len(entry.value)),
                str(entry.value.shape[1]),
                written(found["mean"], goal),
                _range(found["ci95"], goal),
                written(found["iqm"], goal),
                f"{100 * entry.success.mean():.1f}",
            ]
            if entry is other or entry.seeds != other.seeds:
                cells += ["-", "-", "-"]
            else:
                gap = compare(entry.value, other.value, goal.name, sign_of(goal))
                cells += [
                    written(gap[f"{goal.name}_difference"], goal, "+"),
                    _range(gap["ci95"], goal, "+"),
                    f"{100 * gap['probability_of_improvement']:.0f} %",
                ]
            lines.append("| " + " | ".join(map(_cell, cells)) + " |")
    return "\n".join(lines)


def _cell(text: str) -> str:
    """Return a text without separators of cells."""
    return text.replace("|", "\\|")


def metrics_table(entries: Sequence[SummaryRow], names: Sequence[str]) -> str:
    """Return a Markdown table of mean metrics, best policy first in each scenario; a dash where no episode has a value.

    Raises:
        ValueError: If no policy has the metric.
    """
    known = list(dict.fromkeys(name for entry in entries for name in entry.metrics))
    for name in names:
        if name not in known:
            raise ValueError(f"{name} is not evaluated; {', '.join(known)} are")
    lines = ["| scenario | policy | runs | fires | " + " | ".join(names) + " |", "|---" * (4 + len(names)) + "|"]
    for entry in (entry for group in _by_scenario(entries) for entry in group if entry.metrics):
        runs, fires = entry.value.shape
        means = (_mean_of_known(entry.metrics.get(name)) for name in names)
        lines.append(
            f"| {_cell(entry.scenario)} | {_cell(entry.policy)} | {runs} | {fires} | " + " | ".join(means) + " |"
        )
    return "\n".join(lines)


def _mean_of_known(values: np.ndarray | None) -> str:
    known = np.empty(0) if values is None else values[~np.isnan(values)]
    return f"{known.mean():.3f}" if known.size else "-"


def draw_summary(entries: Sequence[SummaryRow], path: Path) -> None:
    """Draw the goal of each scenario, the trees saved or another, with intervals, and the profile of each policy.

    Raises:
        ImportError: If Matplotlib is not installed.
    """
    from matplotlib import rc_context
    from matplotlib.figure import Figure

    groups = _by_scenario(entries)
    policies = list(dict.fromkeys(entry.policy for group in groups for entry in group))
    styles = {policy: line_style(index) for index, policy in enumerate(policies)}
    with rc_context({"font.size": 8.0, "text.parse_math": False, "axes.spines.top": False, "axes.spines.right": False}):
        rows = [max(1.2, _bar_height(group) * len(group) + 0.6) for group in groups]
        columns = min(4, max(1, int(_LEGEND_WIDTH / max(len(policy) + 8 for policy in policies))))
        legend = 0.17 * math.ceil(len(policies) / columns)
        figure = Figure(figsize=(8.0, sum(rows) + legend + 0.2), dpi=140, layout="constrained")
        axes = figure.subplots(len(groups), 2, squeeze=False, height_ratios=rows)
        for (bars, profile), group in zip(axes, groups, strict=True):
            _draw_bars(bars, group, styles)
            goal, (levels, end) = group[0].goal, _levels(group)
            for entry in group:
                shares = 100.0 * performance_profile(sign_of(goal) * entry.value, sign_of(goal) * levels)
                shown = FORMS[goal.unit].factor * levels
                profile.plot(shown, shares, label=entry.policy, linewidth=1.4, **styles[entry.policy])
            profile.set(xlim=(0, end), ylim=(0, 102), ylabel="fires, %")
            if group is groups[-1] or any(goal != each[0].goal for each in groups):
                words, unit = in_words(goal), "" if goal.unit == "1" else goal.unit
                bound = "at most" if goal.better == "less" else "at least"
                bars.set_xlabel(", ".join(filter(None, (f"{words}: mean, 95 % interval", unit))))
                profile.set_xlabel(", ".join(filter(None, (f"{words} on so many fires, {bound}", unit))))
        handles = {h.get_label(): h for row in axes for h in row[1].get_lines()}
        figure.legend(handles=list(handles.values()), loc="outside lower center", ncols=columns, frameon=False)
        with disk.drafted(path) as draft:
            figure.savefig(draft, format=path.suffix[1:] or "png", metadata={"Software": None})


_LABEL_WIDTH, _LEGEND_WIDTH = 32, 130  # characters in a line
_ROOM_BESIDE = 0.87  # of the axis; longer bars have their number inside


def _levels(group: Sequence[SummaryRow]) -> tuple[np.ndarray, float]:
    """Return the levels of a group's profile, and where its axes end, in the unit that is shown."""
    goal = group[0].goal
    top = 1.0 if goal.unit == "%" else float(max(entry.value.max() for entry in group)) or 1.0
    return top * LEVELS, FORMS[goal.unit].factor * top


def _bar_height(group: Sequence[SummaryRow]) -> float:
    """Return the height of a bar that leaves room for the longest label [inches]."""
    return max(0.3, 0.05 + 0.14 * max(_label(entry).count("\n") + 1 for entry in group))


def _label(entry: SummaryRow) -> str:
    return fill(entry.policy, _LABEL_WIDTH, break_long_words=False)


def _draw_bars(axes: Any, group: Sequence[SummaryRow], styles: Mapping[str, Mapping[str, Any]]) -> None:
    (_, end), factor = _levels(group), FORMS[group[0].goal.unit].factor
    for row, entry in enumerate(reversed(group)):
        found = summarise(entry.value)
        mean, (low, high) = factor * found["mean"], (factor * bound for bound in found["ci95"])
        axes.barh(row, mean, height=0.7, color=styles[entry.policy]["color"], alpha=0.75)
        axes.errorbar(mean, row, xerr=[[mean - low], [high - mean]], color="#222222", capsize=2.5, linewidth=1.0)
        place, side = (high + 0.015 * end, "left") if high < _ROOM_BESIDE * end else (low - 0.015 * end, "right")
        axes.text(place, row, written(found["mean"], entry.goal), va="center", ha=side, fontsize=7.0)
    labels = [_label(entry) for entry in reversed(group)]
    axes.set(yticks=range(len(group)), yticklabels=labels, xlim=(0, end))
    axes.set_title(group[0].scenario, fontsize=8.0, loc="left")


def _by_scenario(entries: Sequence[SummaryRow]) -> list[list[SummaryRow]]:
    """Return the entries of each scenario, the best first."""
    scenarios = dict.fromkeys(entry.scenario for entry in entries)
    groups = [[entry for entry in entries if entry.scenario == scenario] for scenario in scenarios]
    return [sorted(group, key=lambda entry: -sign_of(entry.goal) * entry.value.mean()) for group in groups]


def _range(bounds: Sequence[float], goal: Metric, sign: str = "") -> str:
    return " .. ".join(written(bound, goal, sign) for bound in bounds)


@exit_on_signal()
def main(arguments: list[str] | None = None) -> None:
    """Print the table of the given runs, and draw the figure if asked to."""
    parser = FlagParser(prog="warp summary", description=__doc__)
    parser.epilog = WORDS
    parser.add_argument("folders", nargs="+", type=Path, metavar="FOLDER", help="runs, or folders of runs")
    parser.add_argument("--against", metavar="POLICY", help="compare with this policy instead of the best")
    parser.add_argument("--show", nargs="+", metavar="METRIC", help="means of these, of what evaluation.json holds")
    parser.add_argument("--plot", type=Path, metavar="FILE", help="draw them as well")
    told = "draw the forest saved over training, the mean over seeds with its 95 %% bootstrap interval"
    parser.add_argument("--curves", type=Path, metavar="FILE", help=told)
    parser.add_argument("--marl-eval", type=Path, metavar="FILE", help="write the JSON that marl-eval reads")
    parser.add_argument("--rliable", type=Path, metavar="FILE", help="write scores and curves for rliable, as JSON")
    options = parser.parse_args(arguments)
    for folder in options.folders:
        if not folder.is_dir():
            parser.error(f"FOLDER must be a folder that is there, got {folder}")
    try:
        entries = read_rows(*options.folders)
    except (OSError, ValueError) as error:
        parser.error(plain_text(str(error)))
    if not entries:
        parser.error(f"no evaluation.json under {', '.join(map(str, options.folders))}")
    try:
        print(metrics_table(entries, options.show) if options.show else summary_table(entries, options.against))
    except ValueError as error:
        parser.error(plain_text(str(error)))
    for key, make in (("marl_eval", marl_eval), ("rliable", rliable)):
        path = getattr(options, key)
        if path is not None:
            _or_refuse(parser, key, partial(_write_json, make, entries, path))
    for key, draw in (("plot", draw_summary), ("curves", draw_curves)):
        path = getattr(options, key)
        if path is not None:
            _or_refuse(parser, key, partial(draw, entries, path))


def _write_json(make: Callable[[Sequence[SummaryRow]], Any], entries: Sequence[SummaryRow], path: Path) -> None:
    disk.replace(path, json.dumps(make(entries)))


def _or_refuse(parser: FlagParser, key: str, write: Callable[[], None]) -> None:
    """Write a file, or end with a line where it cannot be written."""
    try:
        write()
    except (OSError, ValueError) as error:  # a format that Matplotlib does not write; runs without curves
        parser.error(f"{key}: {plain_text(str(error))}")
    except ImportError:
        parser.error(f'{key} needs Matplotlib: pip install "warp_torchrl[figures]"')


if __name__ == "__main__":
    if hasattr(signal, "SIGPIPE"):
        signal.signal(signal.SIGPIPE, signal.SIG_DFL)  # ends quietly when piped into head
    main()
