"""Questions of fire managers: which fires escape initial attack, by wind, by when the vehicles come, by their number.

One of the three changes at a time; the others stay as the scenario has them. All policies meet the same fires.
"""

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np
import torch

from warp_torchrl.api.make import make_env
from warp_torchrl.benchmark.tables import TableColumn, table
from warp_torchrl.benchmark.tasks import FIRST_SEED
from warp_torchrl.env import WildfireEnv
from warp_torchrl.env.pictures.drawing import GRID, line_style, save_figure, sheet, style
from warp_torchrl.evaluation.play import play, play_heuristics
from warp_torchrl.evaluation.statistics import interval
from warp_torchrl.runs.config.construction import ConfigError
from warp_torchrl.runs.policies.load import load_policy

SCENARIO = "initial_attack"
METRIC = "escaped"
POLICIES = ("noop", "local", "coordinated", "dispatch")
AXES = {"winds": "wind [m/s]", "minutes": "vehicles come after [min]", "vehicles": "vehicles"}
"""What is varied, and what tables and figures call it."""
VALUES = {"winds": (0.0, 4.0, 8.0, 12.0), "minutes": (10.0, 30.0, 60.0, 120.0), "vehicles": (3.0, 6.0, 9.0, 12.0)}
"""Values by default."""


def escapes(
    scenario: str,
    device: str,
    episodes: int,
    values: Mapping[str, Sequence[float]],
    policies: Sequence[str] = POLICIES,
    team: str | None = None,
    overrides: Sequence[str] = (),
) -> list[dict[str, Any]]:
    """Return a row for each value of what is varied: the share of fires that escape, with 95 % intervals, by policy.

    Args:
        scenario: One whose worlds have the mechanics ``values`` and, to vary ``minutes``, ``arrivals``.
        device: Where the worlds live.
        episodes: Fires, on seeds from ``FIRST_SEED`` on.
        values: Of each of ``AXES`` that is varied.
        policies: Baselines.
        team: A trained team that plays too: a run folder, or the name of a shipped policy; None: none.
        overrides: Further ones in all worlds.

    Raises:
        ConfigError: If the scenario does not tell which fires escape.
    """
    roles = _roles(scenario, overrides)
    return [
        {"axis": axis, "value": value, "episodes": episodes}
        | _shares(scenario, device, episodes, policies, team, [*overrides, *_changes(axis, value, roles)])
        for axis, of_axis in values.items()
        for value in of_axis
    ]


def _roles(scenario: str, overrides: Sequence[str]) -> tuple[str, ...]:
    """Return the roles of a scenario's team."""
    env = make_env(scenario, n_worlds=1, seed=FIRST_SEED, overrides=overrides)
    if METRIC not in env.world.metric_names:
        raise ConfigError(f"scenario must tell which fires escape, mechanics.values, got {scenario}")
    return tuple(dict.fromkeys(env.world.team.agent_roles))


def _changes(axis: str, value: float, roles: Sequence[str]) -> list[str]:
    """Return the overrides by which one value of an axis is set."""
    if axis == "winds":
        return [f"wind.speed={value:g}"]
    if axis == "vehicles":
        return [f"team.n_agents={round(value)}"]
    return [f"mechanics.arrivals.minutes={{{','.join(f'{role}:{value:g}' for role in roles)}}}"]


def _shares(
    scenario: str, device: str, episodes: int, policies: Sequence[str], team: str | None, overrides: Sequence[str]
) -> dict[str, Any]:
    """Return the share of fires that escape each policy, and its interval, by name."""
    env = make_env(scenario, n_worlds=episodes, seed=FIRST_SEED, device=device, overrides=overrides)
    found = {name: each[METRIC] for name, each in play_heuristics(env, FIRST_SEED, policies).items()}
    if team is not None:
        found[team] = _of_team(team, scenario, device, episodes, overrides)
    return {"escaped": {name: {"mean": float(each.mean()), "ci95": _interval(each)} for name, each in found.items()}}


def _of_team(team: str, scenario: str, device: str, episodes: int, overrides: Sequence[str]) -> np.ndarray:
    """Return which fires escape a trained team, float64 [episodes]."""
    policy = load_policy(team).to(torch.device(device))
    env: WildfireEnv = make_env(
        scenario, n_worlds=episodes, seed=FIRST_SEED, device=device, overrides=[*policy.overrides, *overrides]
    )
    return play(env, policy.fitted(env), FIRST_SEED, policy.mode)[METRIC]


def _interval(escaped: np.ndarray) -> tuple[float, float]:
    low, high = interval(escaped, lambda values: values.mean(axis=-1))
    return float(low), float(high)


def attack_table(rows: Sequence[dict[str, Any]]) -> str:
    """Return a table for each of what was varied."""
    parts = []
    for axis in dict.fromkeys(row["axis"] for row in rows):
        own = [row for row in rows if row["axis"] == axis]
        columns: list[TableColumn] = [(AXES[axis], lambda row: f"{row['value']:g}")]
        columns += [_column(name) for name in own[0]["escaped"]]
        parts.append(table(columns, own))
    told = f"Fires that escape, % of {rows[0]['episodes']}, seeds from {FIRST_SEED}, and 95 % intervals"
    return "\n\n".join((told, *parts))


def _column(policy: str) -> TableColumn:
    return policy, lambda row: _cell(row["escaped"][policy])


def _cell(found: Mapping[str, Any]) -> str:
    low, high = (100.0 * bound for bound in found["ci95"])
    return f"{100.0 * found['mean']:.0f} ({low:.0f}..{high:.0f})"


def draw_attack(rows: Sequence[dict[str, Any]], path: Path) -> None:
    """Draw the share of fires that escape over each of what was varied, a line for each policy.

    Args:
        rows: What ``escapes`` returns.
        path: PNG to write.
    """
    axes_drawn = list(dict.fromkeys(row["axis"] for row in rows))
    with style():
        figure, panels = sheet([axes_drawn], (2.6 * len(axes_drawn) + 0.6, 3.0), "Fires that escape initial attack")
        for axis in axes_drawn:
            own, panel = [row for row in rows if row["axis"] == axis], panels[axis]
            panel.grid(color=GRID, linewidth=0.5)
            panel.set_axisbelow(True)
            for index, name in enumerate(own[0]["escaped"]):
                found = [row["escaped"][name] for row in own]
                values = [row["value"] for row in own]
                line = line_style(index)
                panel.plot(values, [100.0 * each["mean"] for each in found], label=name, **line)
                low, high = zip(*(each["ci95"] for each in found), strict=True)
                bounds = [[100.0 * each for each in ends] for ends in (low, high)]
                panel.fill_between(values, *bounds, color=line.get("color"), alpha=0.15, linewidth=0)
            panel.set(xlabel=AXES[axis], ylim=(-3, 103))
        panels[axes_drawn[0]].set_ylabel("escape [%]")
        handles, labels = panels[axes_drawn[0]].get_legend_handles_labels()
        figure.legend(handles, labels, loc="outside lower center", ncols=4)
        save_figure(figure, path)
