"""Speed, calibration of scenarios and checks of fires: ``warp benchmark WHAT``.

WHAT is tick, env, train, scaling, processes, tasks, attack, rewards, generalist, fires, ellipses, predict, twins,
witness or beliefs; several run one after the other. gpu runs alone: it measures everything on a card in under five
minutes, and writes it to a file.
"""

import argparse
import json
import logging
import sys
from argparse import Namespace
from collections.abc import Callable, Sequence
from importlib.util import find_spec
from pathlib import Path
from typing import Any

import torch

from warp_torchrl.benchmark.attack import AXES, POLICIES, SCENARIO, VALUES, attack_table, draw_attack, escapes
from warp_torchrl.benchmark.beliefs import belief_table, draw_reliability, reliability
from warp_torchrl.benchmark.environments import LARGE, environment_speed, rate_table
from warp_torchrl.benchmark.fires import ellipse_errors, fire_table, law_times
from warp_torchrl.benchmark.generalist import PLACES, generalise, generalist_table, on_ground, table_line
from warp_torchrl.benchmark.generalist_figure import draw_generalist
from warp_torchrl.benchmark.gpu import SMALL, Size, measure_gpu
from warp_torchrl.benchmark.growth_figure import draw_growth
from warp_torchrl.benchmark.machine import header, machine, peak_memory
from warp_torchrl.benchmark.predictions import prediction_costs, prediction_table
from warp_torchrl.benchmark.processes import cores, process_scaling, process_table
from warp_torchrl.benchmark.scaling import growth, growth_table
from warp_torchrl.benchmark.shares import share_table
from warp_torchrl.benchmark.tasks import (
    EPISODES,
    SCENARIOS,
    calibrate,
    mean_returns,
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
from warp_torchrl.commands.program import flag_arguments, one_line_end
from warp_torchrl.heuristics import HEURISTICS
from warp_torchrl.runs.checkpoint import CheckpointError
from warp_torchrl.runs.config.construction import ConfigError
from warp_torchrl.system.flags import FlagParser, file_to_write, whole
from warp_torchrl.system.malloc import keep_freed_memory
from warp_torchrl.validation import did_you_mean

Rows = list[dict[str, Any]]
_WORLDS = 256


def _speed(measure: Callable[..., Rows], options: Namespace, **more: Any) -> Rows:
    """Measure the scenarios of the command line; without one, ``large`` with the settings of the speed targets."""
    asked: list[tuple[str, Sequence[str]]] = [(name, ()) for name in options.scenario or ()] or [LARGE]
    return [
        row
        for name, changes in asked
        for row in measure(
            name, _worlds(options), options.device, [*changes, *options.set], repeats=options.repeats, **more
        )
    ]


def _worlds(options: Namespace) -> int:
    return _WORLDS if options.worlds is None else options.worlds


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


_MEASURES = {
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
_TABLES = {
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


def _parser() -> argparse.ArgumentParser:
    parser = FlagParser(prog="warp benchmark", description=__doc__)
    told = f"of {', '.join(_MEASURES)} and gpu: env and train by default"
    parser.add_argument("what", nargs="*", choices=[[], *_MEASURES, "gpu"], metavar="WHAT", help=told)
    parser.add_argument(
        "--scenario",
        nargs="+",
        help="by default spread_large with team.n_agents=4 steps_per_tick=1 for speed, default for training; all for "
        "tasks, two for rewards",
    )
    parser.add_argument("--set", nargs="+", default=[], metavar="KEY=VALUE", help="overrides, as for train.py")
    parser.add_argument("--experiment", help="for train: one of conf/experiment, also with Stable-Baselines3's PPO")
    parser.add_argument("--worlds", type=whole(1, 4096), help=f"{_WORLDS} by default, or the experiment's")
    parser.add_argument("--repeats", type=whole(1, 1000), default=7, help="times that each speed is measured")
    parser.add_argument("--no-compile", action="store_true", help="for tick and env: leave what is compiled out")
    parser.add_argument(
        "--plot", type=file_to_write, metavar="FILE.png", help="for scaling, attack, generalist or beliefs: draw it"
    )
    parser.add_argument("--episodes", type=whole(1, 4096), default=EPISODES)
    parser.add_argument(
        "--policies",
        nargs="+",
        choices=HEURISTICS,
        metavar="NAME",
        help="for attack and tasks: these heuristics, of tasks the last paired",
    )
    parser.add_argument("--winds", type=float, nargs="+", help="for attack: m/s")
    parser.add_argument("--minutes", type=float, nargs="+", help="for attack: until the vehicles come")
    parser.add_argument("--vehicles", type=whole(1, 256), nargs="+", help="for attack: how many")
    parser.add_argument("--team", metavar="RUN", help="for attack: a trained team beside, a run or a shipped policy")
    parser.add_argument("--policy", default="generalist", help="for generalist: a run folder, or a shipped policy")
    parser.add_argument(
        "--places", nargs="+", metavar="GROUP", help=f"for generalist: {', '.join(PLACES)}, ground, or one row"
    )
    parser.add_argument("--ground", metavar="FOLDER", help="for generalist: rasters, for places on real ground")
    parser.add_argument("--fires", type=whole(1, 100_000), default=1000, help="for fires: how many of each law")
    parser.add_argument("--reach", type=whole(1, 1000), default=60, help="for ellipses: cells that the heads go")
    told = "for predict: cells of a side of each map"
    parser.add_argument("--sides", type=whole(40, 20_000), nargs="+", default=[500, 1000, 2000], help=told)
    parser.add_argument("--hours", type=whole(1, 1000), default=12, help="for predict: how long the fire is followed")
    parser.add_argument("--twins", type=whole(1, 10_000), default=20, help="for twins: hidden fires of each kind")
    told = "for twins: how many forecast each"
    parser.add_argument("--members", type=whole(2, 10_000), nargs="+", default=[100], help=told)
    parser.add_argument("--hidden", nargs="+", metavar="WORD", help=f"for twins: first words of {'; '.join(HIDDEN)}")
    parser.add_argument("--beds", type=whole(1, 1_000_000), default=2000, help="for witness: random fuel beds")
    parser.add_argument("--device", help="cpu by default; for gpu cuda, and cpu shows in small that it runs")
    parser.add_argument("--file", type=file_to_write, default=Path("gpu.json"), metavar="FILE.json", help="for gpu")
    parser.add_argument("--json", action="store_true", help="print JSON instead of tables")
    return parser


def _gpu(parser: argparse.ArgumentParser, options: Namespace) -> None:
    if options.what != ["gpu"]:
        parser.error("gpu is measured alone")
    if options.device is None and not torch.cuda.is_available():
        parser.exit(2, "error: torch finds no CUDA device here; device=cpu shows in small what gpu measures\n")
    device = options.device or "cuda"
    logging.getLogger("torchrl").setLevel(logging.WARNING)
    if not measure_gpu(device, options.file, SMALL if device == "cpu" else Size()):
        parser.exit(1, f"error: a part was not measured, see {options.file}\n")


@one_line_end()
def main(arguments: list[str] | None = None) -> None:
    """Run the benchmarks that the command line names, and print the results."""
    parser = _parser()
    options = parser.parse_args(flag_arguments(arguments))
    if options.plot is not None and find_spec("matplotlib") is None:
        parser.error("plot needs matplotlib (extra figures)")
    if "gpu" in options.what:
        _gpu(parser, options)
        return
    options.device = options.device or "cpu"
    keep_freed_memory()
    logging.getLogger("torchrl").setLevel(logging.WARNING)  # it prints about its buffers to standard output
    described = machine(options.device)
    if not options.json:
        print(header(described), flush=True)
    found: dict[str, Rows] = {}
    for each in options.what or ["env", "train"]:
        try:
            sections = _MEASURES[each](options)
        except (ValueError, CheckpointError) as error:
            parser.exit(2, f"error: {error}\n")
        found |= sections
        for name, rows in sections.items() if not options.json else ():
            print(f"\n{_TABLES[name](rows)}", flush=True)
    if options.json:
        if "rewards" in found:
            found["rewards"] = [mean_returns(row) for row in found["rewards"]]
        print(json.dumps({"machine": described, **found, "peak_memory_gib": peak_memory()}, indent=1))
    else:
        print(f"\npeak memory of this process: {peak_memory():.2f} GiB")


if __name__ == "__main__":
    main()
