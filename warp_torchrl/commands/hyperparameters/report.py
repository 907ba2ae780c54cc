"""Report of a search: a table, a CSV, and the best values as an experiment and as overrides."""

import csv
import io
import math
import shlex
import warnings
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

import optuna
import yaml
from optuna.trial import FrozenTrial, TrialState

from warp_torchrl.commands.hyperparameters.search import TRIALS, best_of
from warp_torchrl.evaluation.goal import SAVED
from warp_torchrl.evaluation.units import headed, sign_of, told, written
from warp_torchrl.runs.config.compose import GROUPS, choices, compose_config
from warp_torchrl.runs.config.construction import COMPONENTS
from warp_torchrl.runs.config.options import SearchOptions
from warp_torchrl.runs.config.plain_values import plain
from warp_torchrl.runs.config.space import Dimension, value_of
from warp_torchrl.system import disk
from warp_torchrl.world.mechanics.mechanic import Metric

TABLE, CSV, BEST = "search.md", "search.csv", "experiment/best.yaml"
_STATES = {
    TrialState.COMPLETE: "trained",
    TrialState.PRUNED: "pruned",
    TrialState.RUNNING: "training",
    TrialState.WAITING: "waiting",
    TrialState.FAIL: "failed",
}
_MISSING = object()
_FEWEST_FOR_IMPORTANCE = 10


def write(
    study: optuna.Study,
    space: Sequence[Dimension],
    fixed: Sequence[str],
    options: SearchOptions,
    folder: Path,
    goal: Metric = SAVED,
) -> str:
    """Write table, CSV and best values into a search's folder, and return the table with what is said below it."""
    page = "\n\n".join([trials_table(study, space, goal), *_notes(study, space, fixed, options, folder, goal)])
    disk.replace(folder / TABLE, page + "\n")
    disk.replace(folder / CSV, _csv(study, space, goal))
    best = best_of(study, goal)
    if best is not None:
        (folder / BEST).parent.mkdir(exist_ok=True)
        disk.replace(folder / BEST, experiment(_best_overrides(best, space, fixed), _told(best, options, goal)))
    return page


def in_order(study: optuna.Study, goal: Metric = SAVED) -> list[FrozenTrial]:
    """Return the trials, the best first, then the pruned ones by how far they came, then the others."""
    order, sign = list(_STATES), sign_of(goal)
    trials = [each for each in study.get_trials(deepcopy=False) if each.state != TrialState.WAITING]
    return sorted(trials, key=lambda each: (order.index(each.state), -_at(each), _rank(each, sign), each.number))


def _at(trial: FrozenTrial) -> int:
    """Return the share of its training at which a pruned trial was compared last [%]."""
    return max(trial.intermediate_values, default=0) if trial.state == TrialState.PRUNED else 0


def _rank(trial: FrozenTrial, sign: float) -> float:
    return math.inf if trial.value is None else -sign * trial.value


def trials_table(study: optuna.Study, space: Sequence[Dimension], goal: Metric = SAVED) -> str:
    """Return a Markdown table of the trials.

    The goal is the value of a trial that was trained to its end, and that in training of a pruned one where it ended.
    """
    importance = _importance(study)
    lines = [
        f"| trial | state | {headed(goal)} | lowest .. highest seed | " + " | ".join(each.key for each in space) + " |",
        "|---" * (4 + len(space)) + "|",
    ]
    for trial in in_order(study, goal):
        seeds = trial.user_attrs.get("values", ())
        cells = [
            f"{trial.number}, as it is" if trial.user_attrs.get("as it is") else str(trial.number),
            f"pruned at {_at(trial)} %" if trial.state == TrialState.PRUNED else _STATES[trial.state],
            "-" if trial.value is None else written(trial.value, goal),
            f"{written(min(seeds), goal)} .. {written(max(seeds), goal)}" if len(seeds) > 1 else "-",
            *(_shown(trial.params.get(each.key, "-")) for each in space),
        ]
        lines.append("| " + " | ".join(cells) + " |")
    if importance:
        shares = [f"{100.0 * importance.get(each.key, 0.0):.0f} %" for each in space]
        lines.append("| importance | | | | " + " | ".join(shares) + " |")
    return "\n".join(lines)


def _shown(value: Any) -> str:
    return f"{value:.4g}" if isinstance(value, float) else str(value)


def _importance(study: optuna.Study) -> Mapping[str, float]:
    """Return the importance of each key for the best trials, by PED-ANOVA (Watanabe et al. 2023).

    It is empty where fewer than ten trials were trained to their end.
    """
    trained = study.get_trials(deepcopy=False, states=(TrialState.COMPLETE,))
    if len(trained) < _FEWEST_FOR_IMPORTANCE or len({each.value for each in trained}) == 1:
        return {}
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")
        evaluator = optuna.importance.PedAnovaImportanceEvaluator()
        return optuna.importance.get_param_importances(study, evaluator=evaluator)


def _notes(
    study: optuna.Study,
    space: Sequence[Dimension],
    fixed: Sequence[str],
    options: SearchOptions,
    folder: Path,
    goal: Metric,
) -> list[str]:
    best = best_of(study, goal)
    if best is None:
        return ["No trial was trained to its end."]
    overrides = " ".join(shlex.quote(each) for each in _best_overrides(best, space, fixed))
    pruned = study.get_trials(deepcopy=False, states=(TrialState.PRUNED,))
    return [
        *(["Of a pruned trial it is that in training, where it ended."] if pruned else []),
        _told(best, options, goal) + " " + _noise(study, options, goal),
        f"    python train.py {overrides}",
        f"    python train.py --config-dir {shlex.quote(str(folder))} experiment=best",
        f"The table is in {folder / TABLE}, for programs in {folder / CSV}, every training in {folder / TRIALS}.",
    ]


def _told(best: FrozenTrial, options: SearchOptions, goal: Metric) -> str:
    where = "in its evaluation" if options.objective == "evaluation" else "in the last fifth of its training"
    first = ", the values that the configuration has" if best.user_attrs.get("as it is") else ""
    return f"The best is trial {best.number}{first}: {told(best.value or 0.0, goal)} {where}."


def _noise(study: optuna.Study, options: SearchOptions, goal: Metric) -> str:
    """Return what is known of the seeds' differences."""
    train = "Train the best ones with other seeds before you believe a difference: -m seed=10,11,12."
    if options.seeds == 1:
        return f"Each trial is one seed, so that some of the differences between trials are the seeds'. {train}"
    trained = study.get_trials(deepcopy=False, states=(TrialState.COMPLETE,))
    spread = [_variance(each.user_attrs["values"]) for each in trained]
    deviation = math.sqrt(sum(spread) / len(spread))
    of_mean = deviation / math.sqrt(options.seeds)
    unit = "" if goal.unit == "1" else f" {goal.unit}"
    return (
        f"Seeds of one trial differ by {written(deviation, goal)}{unit} (standard deviation), means of {options.seeds} "
        f"by {written(of_mean, goal)}{unit}. {train}"
    )


def _variance(values: Sequence[float]) -> float:
    mean = sum(values) / len(values)
    return sum((value - mean) ** 2 for value in values) / (len(values) - 1)


def _csv(study: optuna.Study, space: Sequence[Dimension], goal: Metric) -> str:
    """Return the trials, a row each: shares from 0 to 1, empty where there is none."""
    text = io.StringIO(newline="")
    rows = csv.writer(text)
    rows.writerow(
        ["trial", "state", goal.name, "lowest", "highest", "percent", "seconds", "reason"] + [s.key for s in space]
    )
    for trial in in_order(study, goal):
        seeds = trial.user_attrs.get("values", ())
        rows.writerow(
            [
                trial.number,
                _STATES[trial.state],
                "" if trial.value is None else trial.value,
                min(seeds, default=""),
                max(seeds, default=""),
                max(trial.intermediate_values, default=""),
                "" if trial.duration is None else round(trial.duration.total_seconds(), 1),
                trial.user_attrs.get("reason", ""),
                *(trial.params.get(each.key, "") for each in space),
            ]
        )
    return text.getvalue()


# The best values


def _best_overrides(best: FrozenTrial, space: Sequence[Dimension], fixed: Sequence[str]) -> list[str]:
    return [*fixed, *(each.override(best.params[each.key]) for each in space)]


def experiment(overrides: Sequence[str], says: str) -> str:
    """Return a training's overrides as the yaml of an experiment.

    An experiment among them is resolved: its options and values are written out, without the ones that the
    overrides replace.

    Args:
        overrides: In Hydra's grammar, each with one value.
        says: Description for the file's comment.
    """
    chosen = choices(overrides)
    scenario = f"scenario={chosen['scenario']}"
    usual = choices([scenario])
    options = {group: chosen[group] for group in COMPONENTS if chosen[group] != usual[group]}
    base = compose_config("train", [scenario, *(f"{group}={option}" for group, option in options.items())])
    values = _differing(plain(compose_config("train", overrides)), plain(base))
    for override in overrides:
        key = override.partition("=")[0]
        if key not in (*COMPONENTS, *GROUPS):
            _put(values, key.split("."), value_of(override))  # also where it is today's default
    defaults = [{f"override /{group}": option} for group, option in {"scenario": chosen["scenario"], **options}.items()]
    text = yaml.safe_dump({"defaults": [*defaults, "_self_"], **values}, sort_keys=False, default_flow_style=False)
    return f"# @package _global_\n# Found by warp search. {says}\n{text}"


def _differing(values: Mapping[str, Any], others: Mapping[str, Any]) -> dict[str, Any]:
    """Return what of nested values is another value than in others, or not there."""
    found: dict[str, Any] = {}
    for key, value in values.items():
        other = others.get(key, _MISSING)
        if isinstance(value, Mapping) and isinstance(other, Mapping):
            inner = _differing(value, other)
            found |= {key: inner} if inner else {}
        elif value != other:
            found[key] = value
    return found


def _put(values: dict[str, Any], path: Sequence[str], value: Any) -> None:
    for part in path[:-1]:
        values = values.setdefault(part, {})
    values[path[-1]] = value
