"""Measures speed and calibrates scenarios: ``python -m warp_torchrl.benchmark [env train tasks]``.

Machines are shared and noisy: figures are medians of several repeats, with the spread.
"""

import argparse
import json
import platform
import resource
import statistics
import sys
import tempfile
import time
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import Any

import tensordict
import torch
import torchrl

from warp_torchrl.api import make_env
from warp_torchrl.config import Record, compose_config, plain, settings
from warp_torchrl.evaluation import play_heuristics
from warp_torchrl.heuristics import HEURISTICS
from warp_torchrl.statistics import summarise
from warp_torchrl.training import Training

SCENARIOS = (
    "skirmish",
    "single",
    "default",
    "large",
    "water",
    "hetero",
    "hazard",
    "shift",
    "ring",
    "lightning",
    "paper_sarl",
    "paper_marl",
)
"""What ``tasks`` plays unless it is told; ``giant`` takes hours, and ``landfire`` needs its rasters."""
EPISODES = 256
FIRST_SEED = 1_000_000


def environment_speed(
    scenario: str, n_worlds: int, device: str, overrides: Sequence[str] = (), repeats: int = 7
) -> dict[str, Any]:
    """Measure agent steps a second of the environment alone: random actions, observations, rewards and resets."""
    env = make_env(scenario, n_worlds=n_worlds, device=device, overrides=overrides)
    now = env.reset()

    def steps(count: int) -> None:
        nonlocal now
        for _ in range(count):
            _, now = env.step_and_maybe_reset(env.rand_action(now))

    steps(env.world.horizon // 2)  # until worlds end at different times
    return {"what": "environment", "scenario": scenario, "worlds": n_worlds} | _rate(
        steps, 25, n_worlds * env.n_agents, repeats, device
    )


def training_speed(
    scenario: str, n_worlds: int, device: str, overrides: Sequence[str] = (), repeats: int = 7
) -> dict[str, Any]:
    """Measure agent steps a second of training: collecting and learning, as ``train.py`` does."""
    config = plain(
        compose_config("train", [f"scenario={scenario}", f"n_worlds={n_worlds}", f"device={device}", *overrides])
    )
    plan = settings(config)
    with tempfile.TemporaryDirectory() as folder:
        training = Training(plan, Record(), Path(folder))
        batches = iter(training.collector)

        def steps(count: int) -> None:
            for _ in range(count):
                training._learn(next(batches))

        steps(1)
        agents = plan.world.team.n_agents
        result = _rate(steps, 1, training.frames_per_batch * agents, repeats, device)
        training.close()
    return {"what": "training", "scenario": scenario, "worlds": n_worlds} | result


def _rate(steps: Callable[[int], None], count: int, agent_steps: int, repeats: int, device: str) -> dict[str, Any]:
    rates = []
    for _ in range(repeats):
        start = time.perf_counter()
        steps(count)
        if device != "cpu":
            torch.cuda.synchronize()
        rates.append(agent_steps * count / (time.perf_counter() - start))
    return {"agent_steps_per_second": statistics.median(rates), "lowest": min(rates), "highest": max(rates)}


def calibrate(scenario: str, device: str, episodes: int, overrides: Sequence[str] = ()) -> dict[str, Any]:
    """Return the trees that each heuristic saves on the evaluation seeds of a scenario."""
    env = make_env(scenario, n_worlds=episodes, seed=FIRST_SEED, device=device, overrides=overrides)
    rows = play_heuristics(env, FIRST_SEED, tuple(HEURISTICS))
    return {"scenario": scenario, "episodes": episodes} | {name: summarise(rows[name]["saved"]) for name in HEURISTICS}


def _header() -> str:
    return (
        f"{platform.machine()}, {torch.get_num_threads()} threads, Python {platform.python_version()}, "
        f"torch {torch.__version__}, torchrl {torchrl.__version__}, tensordict {tensordict.__version__}"
    )


def _speed_table(rows: list[dict[str, Any]]) -> str:
    lines = [f"{'':<12}{'scenario':<12}{'worlds':>7}{'agent steps/s':>15}{'lowest .. highest':>24}"]
    for row in rows:
        spread = f"{row['lowest']:,.0f} .. {row['highest']:,.0f}"
        rate = f"{row['agent_steps_per_second']:,.0f}"
        lines.append(f"{row['what']:<12}{row['scenario']:<12}{row['worlds']:>7}{rate:>15}{spread:>24}")
    return "\n".join(lines)


def _task_table(rows: list[dict[str, Any]]) -> str:
    count = rows[0]["episodes"]
    lines = [
        f"Trees saved, % (mean of {count} episodes, seeds from {FIRST_SEED}, and its 95 % interval)",
        "",
        "| scenario | " + " | ".join(HEURISTICS) + " |",
        "|---|" + "---|" * len(HEURISTICS),
    ]
    for row in rows:
        cells = []
        for name in HEURISTICS:
            low, high = (100 * bound for bound in row[name]["ci95"])
            cells.append(f"{100 * row[name]['mean']:.1f} ({low:.1f} .. {high:.1f})")
        lines.append(f"| {row['scenario']} | " + " | ".join(cells) + " |")
    return "\n".join(lines)


def main(arguments: list[str] | None = None) -> None:
    """Measure what the command line asks for, and print it."""
    parser = argparse.ArgumentParser(prog="python -m warp_torchrl.benchmark", description=__doc__)
    parser.add_argument("what", nargs="*", choices=[[], "env", "train", "tasks"], help="env and train by default")
    parser.add_argument("--scenario", nargs="+", help="default for speed; all of them for tasks")
    parser.add_argument("--set", nargs="+", default=[], metavar="KEY=VALUE", help="overrides, as for train.py")
    parser.add_argument("--worlds", type=int, default=256)
    parser.add_argument("--episodes", type=int, default=EPISODES)
    parser.add_argument("--device", default="cpu")
    parser.add_argument("--json", action="store_true", help="print JSON instead of tables")
    options = parser.parse_args(arguments)
    what = options.what or ["env", "train"]
    speed = {"env": environment_speed, "train": training_speed}
    rows = [
        speed[each](scenario, options.worlds, options.device, options.set)
        for each in what
        if each in speed
        for scenario in options.scenario or ["default"]
    ]
    names = (options.scenario or SCENARIOS) if "tasks" in what else ()
    tasks = [calibrate(name, options.device, options.episodes, options.set) for name in names]
    memory = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / (1 if sys.platform == "darwin" else 1024) / 1024
    if options.json:
        print(json.dumps({"machine": _header(), "speed": rows, "tasks": tasks, "peak_memory_gib": memory}, indent=1))
        return
    print(_header())
    if rows:
        print(_speed_table(rows))
    if tasks:
        print(_task_table(tasks))
    print(f"peak memory of this process: {memory:.2f} GiB")


if __name__ == "__main__":
    main()
