"""The command search: values for keys of a training, found by many trainings."""

import json
import logging
import os
import sys
from collections.abc import Callable, Mapping, Sequence
from dataclasses import fields
from datetime import datetime
from functools import partial
from importlib.util import find_spec
from pathlib import Path
from typing import TYPE_CHECKING, Any

import torch

from warp_torchrl.commands.failure import DONE
from warp_torchrl.commands.program import command_help, run_program
from warp_torchrl.evaluation.goal import goal
from warp_torchrl.runs.checkpoint import holds_any
from warp_torchrl.runs.config.building import run_config
from warp_torchrl.runs.config.compose import GROUPS, compose_config, conf_folder
from warp_torchrl.runs.config.construction import COMPONENTS, ConfigError, UnknownKeyError, construct
from warp_torchrl.runs.config.grammar import check_flags, check_overrides
from warp_torchrl.runs.config.options import SearchOptions
from warp_torchrl.runs.config.plain_values import plain, without_targets
from warp_torchrl.runs.config.space import Dimension, Value, divided
from warp_torchrl.runs.destination import check_free
from warp_torchrl.runs.process import SearchEnded, TrainingProcess
from warp_torchrl.system import disk
from warp_torchrl.system.foreign import read_json
from warp_torchrl.system.lock import RunFolderLock
from warp_torchrl.system.signals import DeferredSignals
from warp_torchrl.training.checks import check_training
from warp_torchrl.world.mechanics.mechanic import Metric

if TYPE_CHECKING:
    import optuna

log = logging.getLogger("warp_torchrl")

USAGE = (
    "warp search [search=NAME] [KEY='tag(log, interval(LOW, HIGH))' ...] [KEY=VALUE ...] "
    "[search.trials=30] [search.jobs=1]"
)
FIRES = 1_000_000_000
"""Seed of the first fire on which a search evaluates: no training has it, and no evaluation unless it is asked to."""
_RECORD = "search.json"
_LARGEST = 1_000_000  # bytes
_NOT_SEARCHED = ("seed", "resume", "debug", "evaluation.first_seed")
_MISSING = object()
_SECONDS_BETWEEN_LOOKS = 1.0
_MAY_CHANGE = ("trials", "jobs", "out")


def main(arguments: Sequence[str] | None = None) -> int:
    """Run the search of the command line, and return the exit code."""
    others = "Every other KEY as for warp train; several values are searched."
    about = command_help(USAGE, SearchOptions, prefix="search.", more=(others,))
    return run_program(arguments, about, _run_to_its_end)


def _run_to_its_end(arguments: Sequence[str]) -> int:
    try:
        return _run(arguments)
    except SearchEnded as error:
        print(f"error: {error}", file=sys.stderr, flush=True)
        return error.code


def _run(arguments: Sequence[str]) -> int:
    logging.basicConfig(level=logging.INFO, format="%(message)s")
    check_flags(arguments)
    for flag in (each for each in arguments if each.startswith("-")):
        raise ConfigError(f"{flag} must be left out: a search takes keys alone")
    check_overrides(arguments)
    options = _options([each for each in arguments if _is_own(each)])
    space, fixed = divided([each for each in arguments if not _is_own(each)], options.space, options.fixed)
    _check_names(space, fixed)
    if find_spec("optuna") is None:
        raise ConfigError('a search needs optuna, which is missing: pip install "warp_torchrl[search]"')
    base = check_points(space, fixed)
    folder = Path(options.out or datetime.now().strftime(f"outputs/searches/%Y-%m-%d/%H-%M-%S-{os.getpid()}"))
    record = _record(space, fixed, options, base)
    _check_folder(folder, record)
    lock = RunFolderLock(folder)
    try:
        disk.replace(folder / _RECORD, json.dumps(record, indent=1))
        return _search(folder, space, fixed, options, base)
    finally:
        lock.release()


def _is_own(argument: str) -> bool:
    return argument.partition("=")[0].lstrip("+~") == "search" or argument.lstrip("+~").startswith("search.")


def _options(overrides: Sequence[str]) -> SearchOptions:
    values = plain(compose_config("search", overrides))["search"]
    options: SearchOptions = construct(SearchOptions, values, "search")
    return options


# Checks before any trial


def _check_names(space: Sequence[Dimension], fixed: Sequence[str]) -> None:
    if not space:
        ready = sorted(path.stem for path in (conf_folder() / "search").glob("*.yaml"))
        raise ConfigError(
            f"nothing is searched: name a ready search, search=NAME of {', '.join(ready)}, or give a key several "
            "values, algorithm.learning_rate='tag(log, interval(1e-4, 3e-3))'"
        )
    for each in space:
        if each.key in _NOT_SEARCHED or each.key.startswith(("hydra", "+", "~")):
            hint = "; search.seeds=N trains each trial with N" if each.key == "seed" else ""
            raise ConfigError(f"{each.key} cannot be searched, got {each.text}{hint}")
    for override in fixed:
        if override.startswith(("hydra", "resume=", "+", "~")):
            raise ConfigError(f"{override} must be left out: a search gives its trainings folders and starts them anew")


def check_points(space: Sequence[Dimension], fixed: Sequence[str]) -> dict[str, Any]:
    """Compose and check trainings at the ends of the space, and return the configuration without what is searched.

    Each value that is an end is checked beside the first ends of the others, and beside the last.

    Raises:
        ConfigError: With the first that is refused, in one line.
    """
    options = [each.override(each.ends()[0]) for each in space if each.key in (*COMPONENTS, *GROUPS)]
    base = plain(compose_config("train", [*fixed, *options]))
    points = {
        tuple(each.override(value if each is moved else each.ends()[end]) for each in space)
        for end in (0, -1)
        for moved in space
        for value in moved.ends()
    }
    for point in sorted(points):
        try:
            check_training(plain(compose_config("train", [*fixed, *point])), [*fixed, *point])
        except UnknownKeyError:
            raise  # whatever the other values are
        except ConfigError as error:
            raise ConfigError(f"{error}, in {' '.join(point)}") from None
    return base


def _record(
    space: Sequence[Dimension], fixed: Sequence[str], options: SearchOptions, base: Mapping[str, Any]
) -> dict[str, Any]:
    """Return the record that identifies a search; a search with another record is another one."""
    from warp_torchrl import __version__

    names = [each.name for each in fields(SearchOptions) if each.name not in ("space", "fixed")]
    return {
        "version": __version__,
        "space": {each.key: each.text for each in space},
        "fixed": list(fixed),
        "search": {name: getattr(options, name) for name in names},
        "configuration": without_targets(base),
    }


def _check_folder(folder: Path, record: Mapping[str, Any]) -> None:
    """Check that a folder is free, or holds this very search."""
    path = folder / _RECORD
    if not path.exists():
        check_free(folder, "search.out")
        return
    try:
        held = read_json(path, _LARGEST)
        before = {part: dict(held[part]) for part in ("space", "search", "configuration")}
    except (ValueError, KeyError, TypeError):
        raise ConfigError(f"search.out: {path} is not the record of a search; take another folder") from None
    for part, values in before.items():
        now = json.loads(json.dumps(record[part]))
        for key in [*values, *(each for each in now if each not in values)]:
            if now.get(key, "") != values.get(key, "") and not (part == "search" and key in _MAY_CHANGE):
                name = f"search.{key}" if part == "search" else key
                was, is_now = (values.get(key, "not searched"), now.get(key, "not searched"))
                raise ConfigError(
                    f"search.out: {folder} holds another search, of which search.trials and search.jobs alone may "
                    f"change: {_differing(name, was, is_now)}; take another folder"
                )


def _differing(name: str, was: Any, now: Any) -> str:
    """Return the first key of nested values that differs, with both values."""
    if isinstance(was, Mapping) and isinstance(now, Mapping):
        key = next(each for each in [*was, *now] if was.get(each) != now.get(each))
        return _differing(f"{name}.{key}", was.get(key), now.get(key))
    return f"{name} was {was}, and is {now}"


# The search


def _search(
    folder: Path, space: Sequence[Dimension], fixed: Sequence[str], options: SearchOptions, base: Mapping[str, Any]
) -> int:
    from warp_torchrl.commands.hyperparameters.report import write
    from warp_torchrl.commands.hyperparameters.search import Search
    from warp_torchrl.commands.hyperparameters.storage import open_study

    aim = goal(run_config(base).world)
    study = open_study(folder, options, aim)
    _first(study, space, base)
    log.info("search %s: %d keys, %d trials", folder, len(space), options.trials)
    write_now = partial(write, study, space, fixed, options, folder, aim)
    with DeferredSignals() as signals:
        search = Search(
            study=study,
            space=space,
            options=options,
            folder=folder,
            start=_starter(space, fixed, options, base["seed"]),
            total=lambda values: int(values.get("total_frames", base["total_frames"])),
            goal=aim,
            after=write_now,
            received=lambda: signals.received,
            seconds=_SECONDS_BETWEEN_LOOKS,
        )
        try:
            search.run()
        finally:
            print(write_now(), flush=True)
            _draw(study, space, folder, aim)
    for each in search.failed:
        print(f"error: trial {each.number} failed: {each.user_attrs['reason']}", file=sys.stderr, flush=True)
    return 1 if search.failed else DONE


def _first(study: "optuna.Study", space: Sequence[Dimension], base: Mapping[str, Any]) -> None:
    """Give the first trial of a new search the configuration's values, where the space holds them."""
    if study.get_trials(deepcopy=False):
        return
    values = {each.key: each.holding(_at(base, each.key)) for each in space}
    if None not in values.values():
        study.enqueue_trial(values, user_attrs={"as it is": True})


def _at(values: Mapping[str, Any], key: str) -> Any:
    """Return a value of a configuration, or a value equal to no other if the key is missing."""
    found: Any = values
    for part in key.split("."):
        found = found.get(part, _MISSING) if isinstance(found, Mapping) else _MISSING
    return found


def _starter(
    space: Sequence[Dimension], fixed: Sequence[str], options: SearchOptions, first_seed: int
) -> Callable[[Mapping[str, Value], int, Path], TrainingProcess]:
    """Return what starts a training of a trial."""
    threads = None
    if "OMP_NUM_THREADS" not in os.environ:
        threads = max(1, torch.get_num_threads() // (options.jobs * options.seeds))
    given = any(each.startswith("evaluation.first_seed=") for each in fixed)
    fires = [] if given else [f"evaluation.first_seed={FIRES}"]

    def start(values: Mapping[str, Value], seed: int, folder: Path) -> TrainingProcess:
        if holds_any(folder):
            return TrainingProcess([f"resume={_quoted(folder)}"], folder, threads)
        same = [each for each in fixed if not each.startswith("seed=")]
        point = [each.override(values[each.key]) for each in space]
        own = [f"seed={first_seed + seed}", "hydra.mode=RUN", f"hydra.run.dir={_quoted(folder)}"]
        return TrainingProcess([*same, *fires, *point, *own], folder, threads)

    return start


def _quoted(path: Path) -> str:
    """Return a path as Hydra's grammar reads it, whatever its name."""
    return "'" + str(path).replace("\\", "\\\\").replace("'", "\\'") + "'"


def _draw(study: "optuna.Study", space: Sequence[Dimension], folder: Path, aim: Metric) -> None:
    from warp_torchrl.commands.hyperparameters.figure import draw_search

    try:
        draw_search(study, space, folder, aim)
    except ImportError:
        log.warning('no search.png: Matplotlib is missing, pip install "warp_torchrl[figures]"')
