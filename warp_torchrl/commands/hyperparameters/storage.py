"""Optuna's storage of a search: one line of JSON for each event.

A kill can cut only the last line, and reading the file runs no code. Optuna's other storage, SQLite, would need a file
system with locks, and a search has one writer.
"""

import warnings
from collections.abc import Sequence
from pathlib import Path

import numpy as np
import optuna
from optuna.storages import JournalStorage
from optuna.storages.journal import JournalFileBackend

from warp_torchrl.commands.hyperparameters.measures import COMPARED_EVERY
from warp_torchrl.evaluation.goal import SAVED
from warp_torchrl.runs.config.construction import ConfigError
from warp_torchrl.runs.config.options import SearchOptions
from warp_torchrl.runs.config.space import Dimension, Value
from warp_torchrl.system.foreign import read_bytes
from warp_torchrl.world.mechanics.mechanic import Metric

JOURNAL = "journal.log"
_STUDY = "search"
_LARGEST = 1_000_000_000  # bytes
_REDUCTION = 3  # hyperband goes on with one trial of so many


def open_study(folder: Path, options: SearchOptions, goal: Metric = SAVED) -> optuna.Study:
    """Return the study in a search's folder, a new one where there is none. Nobody else may write to it.

    A last line that a kill has cut is dropped, as is a lock that it left.

    Raises:
        ConfigError: If what is there is not Optuna's journal.
    """
    optuna.logging.set_verbosity(optuna.logging.ERROR)
    path = folder / JOURNAL
    for left in folder.glob(f"{JOURNAL}.lock*"):
        left.unlink()
    try:
        if path.exists():
            _drop_cut_line(path)
        return optuna.create_study(
            storage=JournalStorage(JournalFileBackend(str(path))),
            study_name=_STUDY,
            direction="minimize" if goal.better == "less" else "maximize",
            pruner=_pruner(options),
            load_if_exists=True,
        )
    except OSError:
        raise
    except Exception as error:  # Optuna raises many types for lines that are not its own
        reason = " ".join(str(error).split())
        raise ConfigError(
            f"search.out: {path} cannot be read, {type(error).__name__}: {reason}; take another folder"
        ) from None


def _drop_cut_line(path: Path) -> None:
    content = read_bytes(path, _LARGEST)
    whole = content.rfind(b"\n") + 1
    if whole < len(content):
        with path.open("r+b") as file:
            file.truncate(whole)


def _pruner(options: SearchOptions) -> optuna.pruners.BasePruner:
    first = max(COMPARED_EVERY, round(100 * options.prune_from))
    if options.pruner == "median":
        return optuna.pruners.MedianPruner(n_startup_trials=options.startup, n_warmup_steps=first)
    if options.pruner == "hyperband":
        return optuna.pruners.HyperbandPruner(min_resource=first, max_resource=100, reduction_factor=_REDUCTION)
    return optuna.pruners.NopPruner()


def ask(study: optuna.Study, space: Sequence[Dimension], options: SearchOptions) -> optuna.Trial:
    """Return a new trial with its values drawn.

    The draws depend on the search's seed and the trial's number only, so a resumed search draws the same values.
    """
    study.sampler = _sampler(options, len(study.get_trials(deepcopy=False)))
    trial = study.ask()
    draw_values(trial, space)
    return trial


def goes_on(study: optuna.Study, number: int, space: Sequence[Dimension], options: SearchOptions) -> optuna.Trial:
    """Return a trial that was begun, with its values; values that a kill left undrawn are drawn."""
    study.sampler = _sampler(options, number)
    trial = optuna.Trial(study, study.get_trials(deepcopy=False)[number]._trial_id)
    draw_values(trial, space)
    return trial


def draw_values(trial: optuna.Trial, space: Sequence[Dimension]) -> dict[str, Value]:
    """Return the values of a trial, drawn where it has none yet."""
    return {each.key: _suggest(trial, each) for each in space}


def _sampler(options: SearchOptions, number: int) -> optuna.samplers.TPESampler:
    seed = np.random.SeedSequence([options.seed, number]).generate_state(1)[0]
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", optuna.exceptions.ExperimentalWarning)
        return optuna.samplers.TPESampler(
            seed=int(seed), n_startup_trials=options.startup, multivariate=True, constant_liar=options.jobs > 1
        )


def _suggest(trial: optuna.Trial, each: Dimension) -> Value:
    if each.choices:
        return str(trial.suggest_categorical(each.key, each.choices))
    if each.is_whole:
        return trial.suggest_int(each.key, int(each.low), int(each.high), step=int(each.step or 1), log=each.log)
    return trial.suggest_float(each.key, each.low, each.high, step=each.step, log=each.log)
