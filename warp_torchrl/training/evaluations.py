"""Evaluations on the way, every ``evaluation.interval`` frames."""

from warp_torchrl.evaluation.goal import goal
from warp_torchrl.evaluation.play import play
from warp_torchrl.evaluation.result import Result
from warp_torchrl.runs.config.run_config import RunConfig
from warp_torchrl.runs.saving import passes
from warp_torchrl.training.callbacks import OngoingTraining


class EvaluationsOnTheWay:
    """A callback that evaluates the policy when it is due, of a mixture on each kind of worlds.

    It adds the columns ``evaluation/saved``, and of a mixture ``evaluation/saved_<kind>``: the share of trees saved. So
    it does of each goal of the worlds: of kinds that have it ``evaluation/<goal>_<kind>``, and where all have the same
    one ``evaluation/<goal>``.

    Args:
        run_config: Configuration of the worlds and the evaluation.
    """

    def __init__(self, run_config: RunConfig) -> None:
        self._config = run_config
        self._goals = [goal(kind.world) for kind in run_config.kinds]
        self._columns = [name for metric in self._metrics() for name in self._names(metric)]

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
        for metric in self._metrics():
            means = [result.mean(metric) for result, its in zip(results, self._having(metric), strict=True) if its]
            values = means if len(results) == 1 or len(means) < len(results) else [sum(means) / len(means), *means]
            row |= dict(zip(self._names(metric), values, strict=True))
        for result in results:
            training.callbacks.call("on_evaluation", training, result)

    def _metrics(self) -> list[str]:
        """Return the metrics of the columns: the trees saved, and the goals of the kinds."""
        return list(dict.fromkeys(("saved", *(each.name for each in self._goals))))

    def _having(self, metric: str) -> list[bool]:
        """Return for each kind whether a metric is shown."""
        return [metric in ("saved", each.name) for each in self._goals]

    def _names(self, metric: str) -> list[str]:
        """Return the columns of a metric: that of all kinds, if all have it, and of several kinds those of each."""
        kinds = self._config.kinds
        having = [kind.name for kind, its in zip(kinds, self._having(metric), strict=True) if its]
        whole = [f"evaluation/{metric}"] if len(having) == len(kinds) else []
        return whole if len(kinds) == 1 else [*whole, *(f"evaluation/{metric}_{name}" for name in having)]
