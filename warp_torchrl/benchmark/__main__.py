"""Speed, calibration of scenarios and checks of fires: ``warp benchmark WHAT``.

WHAT is tick, env, train, scaling, processes, tasks, attack, rewards, generalist, fires, ellipses, predict, twins,
witness or beliefs; several run one after the other. gpu runs alone: it measures everything on a card in under five
minutes, and writes it to a file.
"""

import argparse
import json
import logging
from argparse import Namespace
from importlib.util import find_spec
from pathlib import Path

import torch

from warp_torchrl.benchmark.generalist import PLACES
from warp_torchrl.benchmark.gpu import SMALL, Size, measure_gpu
from warp_torchrl.benchmark.machine import header, machine, peak_memory
from warp_torchrl.benchmark.measures import MEASURES, TABLES, WORLDS, Rows
from warp_torchrl.benchmark.tasks import EPISODES, mean_returns
from warp_torchrl.benchmark.twins import HIDDEN
from warp_torchrl.commands.program import flag_arguments, one_line_end
from warp_torchrl.heuristics import HEURISTICS
from warp_torchrl.runs.checkpoint import CheckpointError
from warp_torchrl.system.flags import FlagParser, file_to_write, whole
from warp_torchrl.system.malloc import keep_freed_memory


def _parser() -> argparse.ArgumentParser:
    parser = FlagParser(prog="warp benchmark", description=__doc__)
    told = f"of {', '.join(MEASURES)} and gpu: env and train by default"
    parser.add_argument("what", nargs="*", choices=[[], *MEASURES, "gpu"], metavar="WHAT", help=told)
    parser.add_argument(
        "--scenario",
        nargs="+",
        help="by default spread_large with team.n_agents=4 steps_per_tick=1 for speed, default for training; all for "
        "tasks, two for rewards",
    )
    parser.add_argument("--set", nargs="+", default=[], metavar="KEY=VALUE", help="overrides, as for train.py")
    parser.add_argument("--experiment", help="for train: one of conf/experiment, also with Stable-Baselines3's PPO")
    parser.add_argument("--worlds", type=whole(1, 4096), help=f"{WORLDS} by default, or the experiment's")
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
            sections = MEASURES[each](options)
        except (ValueError, CheckpointError) as error:
            parser.exit(2, f"error: {error}\n")
        found |= sections
        for name, rows in sections.items() if not options.json else ():
            print(f"\n{TABLES[name](rows)}", flush=True)
    if options.json:
        if "rewards" in found:
            found["rewards"] = [mean_returns(row) for row in found["rewards"]]
        print(json.dumps({"machine": described, **found, "peak_memory_gib": peak_memory()}, indent=1))
    else:
        print(f"\npeak memory of this process: {peak_memory():.2f} GiB")


if __name__ == "__main__":
    main()
