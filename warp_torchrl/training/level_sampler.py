"""Levels of a curriculum in a training: the team's results at each level, and the draws of the next levels."""

import logging
from collections.abc import Mapping
from typing import Any

from tensordict import TensorDictBase

from warp_torchrl.algorithms import parallel
from warp_torchrl.collection.curriculum import Curriculum, CurriculumState
from warp_torchrl.collection.curriculum.state import episodes_by_level
from warp_torchrl.env import LeveledEnv, WildfireEnv
from warp_torchrl.runs.config.run_config import RunConfig
from warp_torchrl.training.baseline import baseline_results

log = logging.getLogger("warp_torchrl")


class LevelSampler:
    """Draws the levels of a training's episodes; the draws are the same in each of its processes.

    Args:
        curriculum: The rule.
        env: Worlds whose levels are drawn.
        baseline: Result of a baseline at each level, if the rule uses one.
    """

    def __init__(self, curriculum: Curriculum, env: LeveledEnv, baseline: tuple[float, ...] = ()) -> None:
        self.curriculum, self.env = curriculum, env
        self.state = CurriculumState.first(len(env.levels), baseline)
        self.draw(0.0)

    def draw(self, progress: float) -> None:
        """Let episodes that start from now on draw their levels by the rule, at progress in 0..1."""
        self.chances = self.curriculum.chances(self.state, progress)
        self.env.draw_by(self.chances)

    def columns(self, batch: TensorDictBase) -> dict[str, float | None]:
        """Update the team's results with the episodes that ended in a batch [B, T] of all processes.

        Returns:
            The columns of ``metrics.csv``: the mean level of the draws while the batch was played, each level's chance,
            and the mean of the episodes by which it was judged last.
        """
        info, done = batch["next", "info"], batch["next", "done"]
        measure, n_levels = self.curriculum.measure, len(self.env.levels)
        ended = parallel.sum_(episodes_by_level(info["level"], done, info[measure], n_levels))
        counts, sums = ended.tolist()
        before, self.state = self.state.level, self.curriculum.after(self.state, counts, sums)
        if self.state.level != before:
            log.info("curriculum: from level %d to level %d", before, self.state.level)
        chances, judged = self.chances, self.state.judged
        return {
            "curriculum/level": sum(level * chance for level, chance in enumerate(chances)),
            **{f"curriculum/chance_{level}": chance for level, chance in enumerate(chances)},
            **{f"curriculum/{measure}_{level}": value for level, value in enumerate(judged)},
        }

    def state_dict(self) -> dict[str, Any]:
        """Return the results at each level."""
        return self.state.state_dict()

    def load_state_dict(self, state: Mapping[str, Any]) -> None:
        """Restore the results of ``state_dict``; ``draw`` then uses them."""
        self.state = CurriculumState.of(state)


def level_sampler(run_config: RunConfig, env: WildfireEnv) -> LevelSampler | None:
    """Return the sampler of a run's levels, after its baseline has played; None without a curriculum."""
    if not isinstance(env, LeveledEnv):
        return None
    return LevelSampler(run_config.curriculum, env, _baseline(run_config))


def _baseline(run_config: RunConfig) -> tuple[float, ...]:
    """Return the results of the curriculum's baseline at each level, on worlds of the training."""
    if run_config.curriculum.asks_for is None:
        return ()
    name, count = run_config.curriculum.asks_for
    found = baseline_results(run_config, run_config.levels, name, count, run_config.curriculum.measure)
    values = ", ".join(f"{value:.3f}" for value in found)
    log.info("curriculum: %s reaches %s of %s, level by level", name, values, run_config.curriculum.measure)
    return tuple(found)
