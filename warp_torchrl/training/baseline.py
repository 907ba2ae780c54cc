"""Results of a baseline in the worlds of a training, for comparison with the team."""

from collections.abc import Sequence

from warp_torchrl.evaluation.play import play_heuristics
from warp_torchrl.runs.config.run_config import RunConfig
from warp_torchrl.world.world import World


def baseline_results(
    run_config: RunConfig, worlds: Sequence[World], name: str, count: int, measure: str
) -> list[float]:
    """Return a heuristic's mean of a measure in each of several worlds, over ``count`` training fires each.

    Args:
        run_config: Configuration of the training.
        worlds: Rules of the worlds.
        name: Name of the heuristic.
        count: Number of fires in each world.
        measure: One of an episode's metrics.
    """
    first = run_config.first_seed
    envs = [run_config.make_env(count, first, world=world) for world in worlds]
    return [float(play_heuristics(env, first, (name,))[name][measure].mean()) for env in envs]
