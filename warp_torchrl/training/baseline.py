"""What a baseline reaches in the worlds of a training, to judge the team by."""

from collections.abc import Sequence

from warp_torchrl.evaluation.play import play_heuristics
from warp_torchrl.runs.config.run_config import RunConfig
from warp_torchrl.runs.config.seeds import first_world_seed
from warp_torchrl.world.world import World


def reached(plan: RunConfig, worlds: Sequence[World], name: str, count: int, measure: str) -> list[float]:
    """Return what a heuristic reaches in each of several worlds, the mean of a measure over so many training fires.

    Args:
        plan: Of the training.
        worlds: Their rules.
        name: Of the heuristic.
        count: Fires of each.
        measure: One of an episode's metrics.
    """
    first = first_world_seed(plan.seed)
    envs = [plan.make_env(count, first, world=world) for world in worlds]
    return [float(play_heuristics(env, first, (name,))[name][measure].mean()) for env in envs]
