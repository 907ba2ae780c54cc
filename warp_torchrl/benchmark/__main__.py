"""Measures speed and calibrates scenarios: ``python -m warp_torchrl.benchmark [env train tasks rewards]``."""

import argparse
import json
import platform
import resource
import sys

import tensordict
import torch
import torchrl

from warp_torchrl.benchmark.speed import environment_speed, speed_table, training_speed
from warp_torchrl.benchmark.tasks import (
    EPISODES,
    SCENARIOS,
    calibrate,
    mean_returns,
    rank_rewards,
    reward_table,
    task_table,
)


def _header() -> str:
    return (
        f"{platform.machine()}, {torch.get_num_threads()} threads, Python {platform.python_version()}, "
        f"torch {torch.__version__}, torchrl {torchrl.__version__}, tensordict {tensordict.__version__}"
    )


def main(arguments: list[str] | None = None) -> None:
    """Measure what the command line asks for, and print it."""
    parser = argparse.ArgumentParser(prog="python -m warp_torchrl.benchmark", description=__doc__)
    kinds = ["env", "train", "tasks", "rewards"]
    parser.add_argument("what", nargs="*", choices=[[], *kinds], help="env and train by default")
    parser.add_argument("--scenario", nargs="+", help="by default default for speed, all for tasks, two for rewards")
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
    pay = [
        rank_rewards(name, options.device, options.episodes, options.set)
        for name in ((options.scenario or ["skirmish", "default"]) if "rewards" in what else ())
    ]
    memory = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / (1 if sys.platform == "darwin" else 1024) / 1024
    if options.json:
        found = {"speed": rows, "tasks": tasks, "rewards": [mean_returns(row) for row in pay]}
        print(json.dumps({"machine": _header(), **found, "peak_memory_gib": memory}, indent=1))
        return
    print(_header())
    if rows:
        print(speed_table(rows))
    if tasks:
        print(task_table(tasks))
    if pay:
        print(reward_table(pay))
    print(f"peak memory of this process: {memory:.2f} GiB")


if __name__ == "__main__":
    main()
