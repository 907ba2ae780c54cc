"""Figure of a search: results of the trials in order, their progress, and results by the values of each key."""

import math
from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING

import optuna
from optuna.trial import FrozenTrial, TrialState

from warp_torchrl.commands.hyperparameters.search import best_of
from warp_torchrl.env.pictures.drawing import BLUE, INK, SOFT, VERMILION, save_figure, sheet, style
from warp_torchrl.evaluation.goal import SAVED
from warp_torchrl.evaluation.units import FORMS, on_axis, sign_of
from warp_torchrl.runs.config.space import Dimension
from warp_torchrl.world.mechanics.mechanic import Metric

if TYPE_CHECKING:
    from matplotlib.axes import Axes

SEARCH_FIGURE = "search.png"
_COLUMNS = 3
_MARGIN = 1.15
_LONGEST = 14  # characters of a choice on an axis


def draw_search(study: optuna.Study, space: Sequence[Dimension], folder: Path, goal: Metric = SAVED) -> None:
    """Draw a search into its folder; nothing where no trial has a value yet.

    Raises:
        ImportError: If Matplotlib is not installed.
    """
    trials = study.get_trials(deepcopy=False)
    trained = [each for each in trials if each.state == TrialState.COMPLETE]
    pruned = [each for each in trials if each.state == TrialState.PRUNED and each.value is not None]
    best, factor = best_of(study, goal), FORMS[goal.unit].factor
    if best is None:
        return
    keys = [each.key for each in space]
    rows = [keys[place : place + _COLUMNS] for place in range(0, len(keys), _COLUMNS)]
    rows[-1] += ["."] * (_COLUMNS - len(rows[-1]))
    layout = [["history", "history", "paths"], *rows]
    with style():
        title = f"{len(trained)} trials trained to the end, {len(pruned)} pruned; the best is trial {best.number}"
        figure, axes = sheet(layout, (8.0, 2.3 + 2.0 * len(rows)), title)
        _history(axes["history"], trained, pruned, best, goal)
        _paths(axes["paths"], [*trained, *pruned], best, goal)
        for each in space:
            _slice(axes[each.key], each, trained, pruned, best, factor)
        for row in rows:
            axes[row[0]].set_ylabel(on_axis(goal))
        for each in axes.values():
            each.spines[["top", "right"]].set_visible(False)
        save_figure(figure, folder / SEARCH_FIGURE)


def _history(
    axes: "Axes", trained: Sequence[FrozenTrial], pruned: Sequence[FrozenTrial], best: FrozenTrial, goal: Metric
) -> None:
    sign, factor = sign_of(goal), FORMS[goal.unit].factor
    best_so_far, values = -math.inf, []
    for each in trained:
        best_so_far = max(best_so_far, sign * (each.value or 0.0))
        values.append(factor * sign * best_so_far)
    axes.step([each.number for each in trained], values, where="post", color=SOFT, linewidth=0.9, label="best so far")
    _points(axes, [each.number for each in trained], trained, "trained", factor)
    _points(axes, [each.number for each in pruned], pruned, "pruned, in training", factor)
    _points(axes, [best.number], [best], "best", factor)
    axes.set(xlabel="trial", ylabel=on_axis(goal))
    axes.xaxis.get_major_locator().set_params(integer=True)
    axes.legend(loc="lower right")


def _points(axes: "Axes", places: Sequence[float], trials: Sequence[FrozenTrial], label: str, factor: float) -> None:
    """Draw trials: dots where they were trained, crosses where they were pruned, a large dot the best."""
    is_pruned = bool(trials) and trials[0].state == TrialState.PRUNED
    look = {"marker": "x", "color": SOFT, "s": 14} if is_pruned else {"marker": "o", "color": BLUE, "s": 14}
    if label == "best":
        look = {"marker": "o", "color": VERMILION, "s": 34, "zorder": 5}
    axes.scatter(places, [factor * (each.value or 0.0) for each in trials], linewidths=0.9, label=label, **look)


def _paths(axes: "Axes", trials: Sequence[FrozenTrial], best: FrozenTrial, goal: Metric) -> None:
    for each in sorted(trials, key=lambda trial: trial.number == best.number):
        shares = sorted(each.intermediate_values)
        colour = VERMILION if each.number == best.number else SOFT if each.state == TrialState.PRUNED else BLUE
        values = [FORMS[goal.unit].factor * each.intermediate_values[share] for share in shares]
        axes.plot(shares, values, color=colour, linewidth=1.4 if colour == VERMILION else 0.7, alpha=0.9)
        if each.state == TrialState.PRUNED and shares:
            axes.plot(shares[-1], values[-1], "x", color=SOFT, markersize=4)
    axes.set(xlabel="share of the training [%]", ylabel=f"{on_axis(goal)}, in training", xlim=(0, 101))


def _slice(
    axes: "Axes",
    each: Dimension,
    trained: Sequence[FrozenTrial],
    pruned: Sequence[FrozenTrial],
    best: FrozenTrial,
    factor: float,
) -> None:
    """Draw the goal by the values of one key."""

    def places(trials: Sequence[FrozenTrial]) -> list[float]:
        values = [trial.params[each.key] for trial in trials]
        if not each.choices:
            return values
        # Trials of one choice lie beside each other, in their order.
        return [each.choices.index(value) + 0.2 * math.sin(2.4 * trial.number) for value, trial in zip(values, trials)]

    _points(axes, places(trained), trained, "trained", factor)
    _points(axes, places(pruned), pruned, "pruned", factor)
    _points(axes, places([best]), [best], "best", factor)
    if each.choices:
        names = [name if len(name) <= _LONGEST else f"{name[: _LONGEST - 3]}..." for name in each.choices]
        axes.set_xticks(range(len(names)), names)
        axes.set_xlim(-0.5, len(names) - 0.5)
    elif each.log:
        _logarithmic(axes, each)
    axes.set_xlabel(each.key, color=INK)


def _logarithmic(axes: "Axes", each: Dimension) -> None:
    """Give an axis the logarithm of a key's values, with as many ticks as there is room for."""
    from matplotlib.ticker import FuncFormatter, LogLocator, NullLocator

    axes.set_xscale("log")
    axes.set_xlim(each.low / _MARGIN, each.high * _MARGIN)
    few = math.log10(each.high / each.low) > 1.5
    axes.xaxis.set_major_locator(LogLocator(subs=(1.0,) if few else (1.0, 3.0)))
    axes.xaxis.set_minor_locator(NullLocator())
    axes.xaxis.set_major_formatter(FuncFormatter(lambda value, place: f"{value:g}"))
