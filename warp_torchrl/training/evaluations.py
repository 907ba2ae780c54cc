"""Evaluations on the way, every ``evaluation.interval`` frames."""

from warp_torchrl.evaluation.goal import goal
from warp_torchrl.evaluation.play import play
from warp_torchrl.evaluation.result import Result
from warp_torchrl.runs.config.run_config import RunConfig
from warp_torchrl.runs.saving import passes
from warp_torchrl.training.callbacks import OngoingTraining


class EvaluationsOnTheWay:
    """A callback that evaluates the policy when it is due, of a mixture on each kind of worlds.

    It adds the columns ``evaluation/saved``, and of a mixture ``evaluation/saved_<kind>``: the share of trees saved.

    Args:
        run_config: Configuration of the worlds and the evaluation.
    """

    def __init__(self, run_config: RunConfig) -> None:
        self._config = run_config
        kinds = run_config.kinds
        names = ["saved"] if len(kinds) == 1 else ["saved", *(f"saved_{kind.name}" for kind in kinds)]
        self._columns = [f"evaluation/{name}" for name in names]

    def on_batch(self, training: OngoingTraining, row: dict[str, float | None]) -> None:
        """Evaluate if it is due, and add the columns; None where it is not."""
        row |= dict.fromkeys(self._columns)
        options = self._config.evaluation
        if not options.interval or not passes(options.interval, training.frames, training.last_batch):
            return
        results = []
        for kind in self._config.kinds:
            env = self._config.make_env(options.episodes, options.first_seed, world=kind.world)
            results.append(
                Result(
                    scenario=kind.name,
                    policy="trained, sampled",
                    first_seed=options.first_seed,
                    episodes=play(env, training.learner.policy, options.first_seed),
                    frames=training.frames,
                    goal=goal(env.world),
                )
            )
        saved = [result.mean() for result in results]
        values = saved if len(saved) == 1 else [sum(saved) / len(saved), *saved]
        row |= dict(zip(self._columns, values, strict=True))
        for result in results:
            training.callbacks.call("on_evaluation", training, result)
