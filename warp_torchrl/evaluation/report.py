"""The report of an evaluation: ``evaluation.json`` and the table for the terminal."""

import json
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np

from warp_torchrl.env.specs import EPISODE_METRICS
from warp_torchrl.evaluation.behaviour import BEHAVIOUR
from warp_torchrl.evaluation.goal import SAVED
from warp_torchrl.evaluation.play import Episodes
from warp_torchrl.evaluation.statistics import compare, summarise
from warp_torchrl.evaluation.units import FORMS, headed, sign_of, written
from warp_torchrl.system import disk
from warp_torchrl.world.mechanics.mechanic import Metric

EXTRA_METRICS = ("averted", *BEHAVIOUR)
WATCHING = ("watched", "found", "uncertainty")
"""Metrics of worlds that keep what a team watches."""

LEGEND = (
    "saved: trees that neither burned nor were cleared; iqm: mean of the middle half of the fires; success: fires out",
    "with 60 % saved; control: share of the horizon until no cell burns; cleared: trees cut down for firebreaks",
)
"""The words under the table of the forest saved."""
WATCHING_LEGEND = (
    "watched: share of the fire's front that the team saw burn in its last steps; found: share that it knows to burn;",
    "uncertainty: 0 where the map was just seen, 1 where it was never, mean over map and steps",
)
MEANING = {
    "averted": "trees saved beyond those of noop, a share of all",
    "division": "bits by which agent and sector of the fire depend on each other",
    "head_attack": "cosine of wind and act, 1 at the fire's head",
    "contested": "share of the extinguished cells that a team-mate targeted too",
    "containment": "share of the directions in which a line closes the fire in",
    "lead_time": "steps from a clearing until the fire is there",
    "unused_breaks": "share of the clearings that the fire never reached",
}
"""The words beside the further rows."""


def report(
    scenario: str,
    policy: str,
    first_seed: int,
    episodes: Episodes,
    others: Mapping[str, Episodes],
    other_modes: Mapping[str, Episodes] | None = None,
    left_out: Mapping[str, Episodes] | None = None,
    method: str | None = None,
    configuration: str = "",
    world_overrides: Sequence[str] = (),
    frames: int | None = None,
    trained: str = "",
    goal: Metric = SAVED,
) -> dict[str, Any]:
    """Return the content of ``evaluation.json``.

    Args:
        scenario: Name of the scenario.
        policy: Name of the policy, with its mode.
        first_seed: Seed of world 0.
        episodes: Episodes of the policy.
        others: Episodes of the baselines in the same worlds, by name.
        other_modes: Episodes of the policy in its other mode, by name.
        left_out: Episodes of the policy without an agent, by the agent's name.
        method: The policy's name in tables of many runs; None takes ``policy``.
        configuration: Digest that distinguishes policies of one method.
        world_overrides: Overrides by which the worlds differ from the scenario.
        frames: World steps of the last training; None for a heuristic.
        trained: All trainings behind it in one line; empty for a heuristic.
        goal: What policies of the team are compared by.
    """
    if "noop" in others:
        episodes = episodes | {"averted": episodes["saved"] - others["noop"]["saved"]}
    count = len(episodes["saved"])
    seeds = list(range(first_seed, first_seed + count))
    rows = [
        {"seed": seed, **{name: _number(values[index]) for name, values in episodes.items()}}
        for index, seed in enumerate(seeds)
    ]
    return {
        "scenario": scenario,
        "world_overrides": list(world_overrides),
        "policy": policy,
        "method": policy if method is None else method,
        "configuration": configuration,
        "frames": frames,
        "trained": trained,
        "goal": goal.name,
        "goal_better": goal.better,
        "goal_unit": goal.unit,
        "seeds": seeds,
        "metrics": _summaries(episodes),
        "episodes": rows,
        "versus": {name: compare(episodes["saved"], other["saved"]) for name, other in others.items()},
        "baselines": {name: _summaries(other) for name, other in others.items()},
        "baseline_episodes": {
            name: {metric: other[metric].tolist() for metric in dict.fromkeys(("saved", "success", goal.name))}
            for name, other in others.items()
        },
        "other_modes": {name: _summaries(other) for name, other in (other_modes or {}).items()},
        "watching": {
            name: compare(episodes["watched"], other["watched"], "watched")
            for name, other in others.items()
            if "watched" in other
        },
        "by_goal": _compared(episodes, others, goal) if goal.name not in ("saved", "watched") else {},
        "left_out": _compared(episodes, left_out or {}, goal),
    }


def _compared(episodes: Episodes, others: Mapping[str, Episodes], goal: Metric) -> dict[str, dict[str, Any]]:
    """Return the differences to other policies in what they are compared by."""
    name, sign = goal.name, sign_of(goal)
    return {other: compare(episodes[name], found[name], name, sign) for other, found in others.items()}


def _summaries(episodes: Episodes) -> dict[str, dict[str, Any]]:
    return {name: summarise(values) for name, values in episodes.items()}


def _number(value: float) -> float | None:
    return None if np.isnan(value) else float(value)


def evaluation_table(content: Mapping[str, Any], metrics: Sequence[Metric] = ()) -> str:
    """Return the report as a table for the terminal; for a team that cannot act, only the metrics of watching.

    Args:
        content: The report.
        metrics: The rows of its worlds' metrics; those that no other line shows have tables to themselves.
    """
    lines = [f"{worlds_name(content)}: {len(content['seeds'])} fires, seeds from {content['seeds'][0]}"]
    rows = {**content["baselines"], **content["other_modes"], content["policy"]: content["metrics"]}
    aim, policy = goal_of(content), content["policy"]
    if aim.name not in ("saved", "watched"):
        lines += [*_goal_lines(aim, rows), *_difference_lines(policy, content["by_goal"], aim)]
    if aim.name != "watched":
        lines += [*_saved_lines(rows), *_difference_lines(policy, content["versus"], SAVED)]
    if content["watching"]:
        lines += [*_watching_lines(rows), *_difference_lines(policy, content["watching"], Metric("watched", "more"))]
    shown = {*EPISODE_METRICS, *EXTRA_METRICS, *WATCHING, aim.name}
    further = [metric for metric in metrics if metric.name not in shown]
    for title in dict.fromkeys(metric.table or metric.name for metric in further):
        lines += _metric_lines([metric for metric in further if title in (metric.table, metric.name)], rows)
    lines += _behaviour_lines(content) if aim.name != "watched" else []
    lines += _left_out_lines(content)
    lines += [f"trained: {content['trained']}"] if content["trained"] else []
    return "\n".join(lines)


def goal_of(content: Mapping[str, Any]) -> Metric:
    """Return what a report's policies are compared by."""
    return Metric(content["goal"], content.get("goal_better", "more"), content.get("goal_unit", "%"))


def _goal_lines(goal: Metric, rows: Mapping[str, Any]) -> list[str]:
    """Return a line for each policy: what the worlds name as their goal."""
    lines = [
        f"{'policy':<22}{headed(goal):>22}{'95 % interval':>22}{'iqm':>10}  "
        f"the goal of this scenario, {goal.better} is better"
    ]
    for name, summary in rows.items():
        found = summary[goal.name]
        interval = " .. ".join(written(bound, goal) for bound in found["ci95"])
        lines.append(f"{name:<22}{written(found['mean'], goal):>22}{interval:>22}{written(found['iqm'], goal):>10}")
    return lines


def _saved_lines(rows: Mapping[str, Any]) -> list[str]:
    """Return a line for each policy, the forest that it saves, and what the columns mean."""
    lines = [
        f"{'policy':<22}{'saved %':>8}{'95 % interval':>16}{'iqm %':>8}{'success %':>11}{'control':>9}{'cleared %':>11}"
    ]
    for name, summary in rows.items():
        saved = summary["saved"]
        lines.append(
            f"{name:<22}{100 * saved['mean']:>8.1f}{_interval(saved):>16}{100 * saved['iqm']:>8.1f}"
            f"{100 * summary['success']['mean']:>11.1f}{summary['control_time']['mean']:>9.2f}"
            f"{100 * summary['cleared']['mean']:>11.2f}"
        )
    return [*lines, *LEGEND]


def _watching_lines(rows: Mapping[str, Any]) -> list[str]:
    """Return a line for each policy, the front that it watches, and what the columns mean."""
    lines = [f"{'policy':<22}{'watched %':>10}{'95 % interval':>16}{'found %':>9}{'uncertainty':>13}"]
    for name, summary in rows.items():
        watched = summary["watched"]
        lines.append(
            f"{name:<22}{100 * watched['mean']:>10.1f}{_interval(watched):>16}{100 * summary['found']['mean']:>9.1f}"
            f"{summary['uncertainty']['mean']:>13.3f}"
        )
    return [*lines, *WATCHING_LEGEND]


def _interval(summary: Mapping[str, Any]) -> str:
    return "{:.1f} .. {:.1f}".format(*(100.0 * bound for bound in summary["ci95"]))


def _difference_lines(policy: str, differences: Mapping[str, Any], metric: Metric) -> list[str]:
    """Return a line for each other policy: the paired difference of a metric."""
    lines, unit = [], FORMS[metric.unit].difference
    for name, difference in differences.items():
        low, high = (written(bound, metric, "+") for bound in difference["ci95"])
        gap = written(difference[f"{metric.name}_difference"], metric, "+")
        lines.append(
            f"{policy} - {name}: {' '.join(filter(None, (gap, unit, metric.name)))}, {low} .. {high}; "
            f"{metric.better} on {100 * difference['probability_of_improvement']:.0f} % of fires"
        )
    return lines


def _metric_lines(metrics: Sequence[Metric], rows: Mapping[str, Any]) -> list[str]:
    """Return a table of metrics: a line of titles, then means and 95 % intervals, a line for each policy."""
    first, are_several = metrics[0], bool(metrics[0].table)
    title = headed(first, first.table)
    title += f", {first.better} is better" if first.better else ""
    width = max(22, len(title) + 2)
    columns = [metric.title or metric.name for metric in metrics] if are_several else []
    lines = [(f"{title:<{width}}" + "".join(f"{column:>24}" for column in columns)).rstrip()]
    for policy, summary in rows.items():
        found = [summary[metric.name] for metric in metrics]
        numbers = [[written(number, first) for number in (each["mean"], *each["ci95"])] for each in found]
        cells = (f"{mean} ({low} .. {high})" for mean, low, high in numbers)
        lines.append(f"{policy:<{width}}" + "".join(f"{cell:>24}" for cell in cells))
    return lines


def worlds_name(content: Mapping[str, Any]) -> str:
    """Return the name of a report's worlds: the scenario and its overrides."""
    return " ".join((content["scenario"], *content.get("world_overrides", ())))


def _behaviour_lines(content: Mapping[str, Any]) -> list[str]:
    lines = []
    for name in EXTRA_METRICS:
        found = content["metrics"].get(name, {"mean": None})
        if found["mean"] is not None:
            low, high = found["ci95"]
            lines.append(
                f"{name.replace('_', ' '):<22}{found['mean']:>8.3f}{f'{low:.3f} .. {high:.3f}':>18}  {MEANING[name]}"
            )
    return lines


def _left_out_lines(content: Mapping[str, Any]) -> list[str]:
    """Return a line for each agent: the team's metric without the agent, minus that with it."""
    lines, aim = [], goal_of(content)
    for agent, loss in content["left_out"].items():
        high, low = (written(-bound, aim, "+") for bound in loss["ci95"])
        gap = written(-loss[f"{aim.name}_difference"], aim, "+")
        lines.append(f"without {agent:<14}{gap:>8}{f'{low} .. {high}':>16}")
    return lines


def write_json(path: Path, content: Mapping[str, Any]) -> None:
    """Write a JSON file atomically."""
    disk.replace(path, json.dumps(content, indent=1))
