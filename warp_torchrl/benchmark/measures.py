"""What each benchmark of ``warp benchmark`` measures, by its name, and the table of its rows."""

import sys
from argparse import Namespace
from collections.abc import Callable, Sequence
from typing import Any

from warp_torchrl.benchmark.attack import AXES, POLICIES, SCENARIO, VALUES, attack_table, draw_attack, escapes
from warp_torchrl.benchmark.beliefs import belief_table, draw_reliability, reliability
from warp_torchrl.benchmark.environments import LARGE, environment_speed, rate_table
from warp_torchrl.benchmark.fires import ellipse_errors, fire_table, law_times
from warp_torchrl.benchmark.generalist import PLACES, generalise, generalist_table, on_ground, table_line
from warp_torchrl.benchmark.generalist_figure import draw_generalist
from warp_torchrl.benchmark.growth_figure import draw_growth
from warp_torchrl.benchmark.machine import machine
from warp_torchrl.benchmark.predictions import prediction_costs, prediction_table
from warp_torchrl.benchmark.processes import cores, process_scaling, process_table
from warp_torchrl.benchmark.scaling import growth, growth_table
from warp_torchrl.benchmark.shares import share_table
from warp_torchrl.benchmark.tasks import (
    SCENARIOS,
    calibrate,
    pair,
    pair_table,
    rank_rewards,
    reward_table,
    task_table,
)
from warp_torchrl.benchmark.ticks import tick_cost, tick_table
from warp_torchrl.benchmark.trainings import training_speed
from warp_torchrl.benchmark.twins import HIDDEN, twin_experiments, twin_table
from warp_torchrl.benchmark.witness import witness_errors, witness_table
from warp_torchrl.runs.config.construction import ConfigError
from warp_torchrl.validation import did_you_mean

Rows = list[dict[str, Any]]
WORLDS = 256
"""Worlds where the command line says none."""


def _speed(measure: Callable[..., Rows], options: Namespace, **more: Any) -> Rows:
    """Measure the scenarios of the command line; without one, ``LARGE``."""
    asked: list[tuple[str, Sequence[str]]] = [(name, ()) for name in options.scenario or ()] or [LARGE]
    return [
        row
        for name, changes in asked
        for row in measure(
            name, _worlds(options), options.device, [*changes, *options.set], repeats=options.repeats, **more
        )
    ]


def _worlds(options: Namespace) -> int:
    return WORLDS if options.worlds is None else options.worlds


def _tick(options: Namespace) -> dict[str, Rows]:
    return {"tick": _speed(tick_cost, options, compiled=not options.no_compile)}


def _env(options: Namespace) -> dict[str, Rows]:
    return {"env": _speed(environment_speed, options, compiled=not options.no_compile)}


def _train(options: Namespace) -> dict[str, Rows]:
    found: dict[str, Rows] = {"train": [], "profile": []}
    common = [] if options.experiment is None else [f"experiment={options.experiment}"]
    if options.experiment is None or options.worlds is not None:
        common.append(f"n_worlds={_worlds(options)}")
    if options.scenario is not None:
        scenarios = [[f"scenario={name}"] for name in options.scenario]
    else:
        scenarios = [["scenario=default"] if options.experiment is None else []]
    for scenario in scenarios:
        overrides = [*common, *scenario, *options.set]
        with_peer = options.experiment is not None
        rates, shares = training_speed(overrides, options.device, options.repeats, with_peer)
        found["train"] += rates
        found["profile"] += shares
    return found


def _scaling(options: Namespace) -> dict[str, Rows]:
    rows = _speed(growth, options)
    if options.plot is not None:
        found = machine(options.device)
        draw_growth(rows, options.plot, f"{found['processor']}, threads: {found['threads']}")
    return {"scaling": rows}


def _processes(options: Namespace) -> dict[str, Rows]:
    rows = []
    for name in options.scenario or ["default"]:
        rows += process_scaling([f"scenario={name}", *options.set], _worlds(options), cores(), options.repeats)
    return {"processes": rows}


def _tasks(options: Namespace) -> dict[str, Rows]:
    names = options.scenario or SCENARIOS
    if options.policies is not None:
        pairs = [pair(name, options.device, options.episodes, options.policies, options.set) for name in names]
        return {"pairs": pairs}
    return {"tasks": [calibrate(name, options.device, options.episodes, options.set) for name in names]}


def _attack(options: Namespace) -> dict[str, Rows]:
    asked = {axis: getattr(options, axis) for axis in AXES if getattr(options, axis) is not None} or VALUES
    rows = []
    for name in options.scenario or [SCENARIO]:
        policies = options.policies or POLICIES
        rows += escapes(name, options.device, options.episodes, asked, policies, options.team, options.set)
    if options.plot is not None:
        draw_attack(rows, options.plot)
    return {"attack": rows}


def _rewards(options: Namespace) -> dict[str, Rows]:
    names = options.scenario or ["skirmish", "default"]
    return {"rewards": [rank_rewards(name, options.device, options.episodes, options.set) for name in names]}


def _generalist(options: Namespace) -> dict[str, Rows]:
    groups = PLACES if options.ground is None else {**PLACES, "ground": on_ground(options.ground)}
    known = {place.name: (place,) for group in groups.values() for place in group if place.rival is None} | groups
    unknown = [name for name in options.places or () if name not in known]
    if unknown:
        needs = ", which needs ground" if unknown[0] == "ground" else did_you_mean(unknown[0], known)
        raise ConfigError(f"places must be of {', '.join(groups)}, or one row of these, got {unknown[0]}{needs}")
    places = [place for name in options.places or groups for place in known[name]]
    rows = []
    for row in generalise(options.policy, places, options.device, options.episodes, options.set):
        rows.append(row)
        print(table_line(row), file=sys.stderr, flush=True)  # large maps take minutes each: what was played is not lost
    if options.plot is not None:
        draw_generalist(rows, options.plot)
    return {"generalist": rows}


def _fires(options: Namespace) -> dict[str, Rows]:
    return {"fires": law_times(options.fires)}


def _ellipses(options: Namespace) -> dict[str, Rows]:
    return {"ellipses": ellipse_errors(options.reach, (0.0, 0.1))}


def _predict(options: Namespace) -> dict[str, Rows]:
    return {"predict": prediction_costs(options.sides, options.hours)}


def _beliefs(options: Namespace) -> dict[str, Rows]:
    names = options.scenario or ["scouts", "search"]
    rows = [row for name in names for row in reliability(name, options.device, options.episodes, options.set)]
    if options.plot is not None:
        draw_reliability(rows, options.plot)
    return {"beliefs": rows}


def _witness(options: Namespace) -> dict[str, Rows]:
    return {"witness": witness_errors(options.beds)}


def _twins(options: Namespace) -> dict[str, Rows]:
    names = [name for name in HIDDEN if not options.hidden or any(name.startswith(each) for each in options.hidden)]
    if not names:
        raise ConfigError(f"hidden must begin one of {'; '.join(HIDDEN)}, got {' '.join(options.hidden)}")
    return {"twins": twin_experiments(names, options.members, options.twins)}


MEASURES: dict[str, Callable[[Namespace], dict[str, Rows]]] = {
    "tick": _tick,
    "env": _env,
    "train": _train,
    "scaling": _scaling,
    "processes": _processes,
    "tasks": _tasks,
    "attack": _attack,
    "rewards": _rewards,
    "generalist": _generalist,
    "fires": _fires,
    "ellipses": _ellipses,
    "predict": _predict,
    "beliefs": _beliefs,
    "twins": _twins,
    "witness": _witness,
}
"""Return rows by the name of their table, of the options of the command line."""
TABLES: dict[str, Callable[[Rows], str]] = {
    "tick": tick_table,
    "env": rate_table,
    "train": rate_table,
    "profile": share_table,
    "scaling": growth_table,
    "processes": process_table,
    "tasks": task_table,
    "pairs": pair_table,
    "attack": attack_table,
    "rewards": reward_table,
    "generalist": generalist_table,
    "fires": fire_table,
    "ellipses": fire_table,
    "predict": prediction_table,
    "beliefs": belief_table,
    "twins": twin_table,
    "witness": witness_table,
}
"""Return the text of rows, by their table's name."""
