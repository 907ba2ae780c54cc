"""The commands train and evaluate. They check everything first, and end a failure with one line and an exit code."""

import logging
import os
import shutil
import sys
import tempfile
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from pathlib import Path

import hydra
from hydra.core.hydra_config import HydraConfig
from hydra.types import RunMode
from omegaconf import DictConfig

from warp_torchrl.algorithms import parallel
from warp_torchrl.commands.checks import CheckFirst
from warp_torchrl.commands.failure import DONE, fail
from warp_torchrl.commands.program import tell
from warp_torchrl.commands.queue import queued
from warp_torchrl.commands.sweep import SweepSummary, remove_failure, save_failure, summarise_unfinished
from warp_torchrl.commands.usage import ASKS, run_help
from warp_torchrl.evaluation.checks import map_fires, of_worlds, picture_kind, without_checkpoint
from warp_torchrl.evaluation.evaluate import announce, evaluate_policy
from warp_torchrl.evaluation.result import Result
from warp_torchrl.runs.config.building import BuildOnce
from warp_torchrl.runs.config.compose import HYDRA_ERRORS, conf_folder, explain, option_of, tidied
from warp_torchrl.runs.config.construction import COMPONENTS, ConfigError
from warp_torchrl.runs.config.grammar import check_flags, check_overrides, flags_first, listed_plugins
from warp_torchrl.runs.config.plain_values import plain
from warp_torchrl.runs.config.plugins import load, registered
from warp_torchrl.runs.config.saved_config import restore, world_overrides
from warp_torchrl.runs.destination import check_free
from warp_torchrl.runs.policies.find import find_policy
from warp_torchrl.system.lock import RunFolderLock
from warp_torchrl.system.malloc import keep_freed_memory
from warp_torchrl.system.parent import SECONDS_TO_SAVE, end_with, is_orphaned
from warp_torchrl.system.signals import DeferredSignals, Stopped, exit_on_signal
from warp_torchrl.training.callbacks import OngoingTraining
from warp_torchrl.training.checks import new_total
from warp_torchrl.training.following import follow_training
from warp_torchrl.training.run import newest, train_composed

log = logging.getLogger("warp_torchrl")

_RECORDED = (*COMPONENTS, "scenario")
_MULTIRUN = ("-m", "--multirun")


def train() -> None:
    """Run ``python train.py`` or ``warp train``; ends the process with an exit code."""
    _run("train", _train_job)


def evaluate() -> None:
    """Run ``python evaluate.py`` or ``warp evaluate``; ends the process with an exit code."""
    _run("evaluate", _evaluate_job)


# The two jobs


def _train_job(config: DictConfig) -> None:
    if parallel.torchrun_rank():
        parallel.follow(follow_training)
        return
    hydra = HydraConfig.get()
    train_composed(
        config,
        _choices(config),
        Path(hydra.runtime.output_dir if config.resume is None else config.resume),
        build=CheckFirst.build,
        total_frames=new_total(config, hydra.overrides.task),
        callbacks=[_Announcer()],
        signals=DeferredSignals(),
        is_job=hydra.mode == RunMode.MULTIRUN,
    )


class _Announcer:
    """A callback that prints the table of the last evaluation."""

    def on_evaluation(self, training: OngoingTraining, result: Result) -> None:
        """Print it once it is written."""
        if result.folder is not None:
            announce(result)


def _evaluate_job(config: DictConfig) -> None:
    folder = Path(HydraConfig.get().runtime.output_dir)
    is_run = (folder / ".lock").exists()
    lock = RunFolderLock(folder)
    try:
        if not config.overwrite:
            check_free(folder, "hydra.run.dir")  # again: two jobs of a sweep may have the same folder
        _evaluate_into(folder, config)
    finally:
        if not is_run:
            (folder / ".lock").unlink(missing_ok=True)
        lock.release()


def _evaluate_into(folder: Path, config: DictConfig) -> None:
    given, name = config.checkpoint, config.policy
    fires, kind = map_fires(plain(config)), picture_kind(plain(config))
    if given is None:
        values = without_checkpoint(plain(config))
        announce(evaluate_policy(CheckFirst.build(values), folder, name, world_overrides(values), fires, kind))
        return
    found = newest(find_policy(given))
    values = plain(restore(found.saved_config(), of_worlds(HydraConfig.get().overrides.task)))
    announce(evaluate_policy(CheckFirst.build(values), folder, found, world_overrides(values), fires, kind))


# The saved configuration


def _choices(config: DictConfig) -> dict[str, str]:
    """Return the option of each group; for one of another folder that of its class, as every value is kept too."""
    chosen = HydraConfig.get().runtime.choices
    options = {group: chosen[group] for group in _RECORDED}
    known = {group: (*registered(group), *_stems(conf_folder() / group)) for group in COMPONENTS}
    own = [group for group in COMPONENTS if options[group] not in known[group]]
    return options | {group: option_of(group, config[group]["_target_"]) for group in own}


def _stems(folder: Path) -> set[str]:
    return {path.stem for path in folder.glob("*.yaml")}


# The start of a command, and errors


def _run(name: str, job: Callable[[DictConfig], None]) -> None:
    arguments = sys.argv[1:]
    debug = "debug=true" in [each.lower() for each in arguments]
    logging.raiseExceptions = debug  # a full disk must not print a second error
    os.environ["HYDRA_FULL_ERROR"] = "1"  # Hydra then raises its errors instead of printing them
    keep_freed_memory()
    CheckFirst.build = BuildOnce()
    if parallel.is_torchrun():
        end_with(os.getppid(), SECONDS_TO_SAVE)
    with exit_on_signal():
        try:
            _check_grammar(arguments)
            load(listed_plugins(arguments))
            if any(each in ASKS for each in arguments):
                tell(run_help(name, _overrides(arguments)))
                sys.exit(DONE)
            if parallel.torchrun_rank():
                with folder_of_its_own() as quiet:
                    _start_hydra(name, job, [*_without_folder(arguments), *quiet], debug)
            else:
                _start_hydra(name, job, arguments, debug)
        except HYDRA_ERRORS as error:
            sys.exit(fail(explain(error, name, _overrides(arguments)), debug)[0])
        except Exception as error:
            sys.exit(fail(error, debug)[0])
        sys.exit(SweepSummary.exit_code)


def _start_hydra(name: str, job: Callable[[DictConfig], None], arguments: list[str], debug: bool) -> None:
    if name == "train" and not parallel.torchrun_rank():
        arguments = _with_run_folder(arguments)
    sys.argv[1:] = flags_first(arguments)

    def guarded(config: DictConfig) -> None:
        with queued() as queue:
            try:
                remove_failure()
                overrides = list(HydraConfig.get().overrides.task)
                load(listed_plugins(overrides))  # again: a sweep's launcher may run the job in another process
                job(tidied(config, overrides))
            except Exception as error:
                code, line = fail(queue.explain(error), debug)
                if is_orphaned():
                    os._exit(code)  # the sweep has ended, and so does its worker
                queue.start_again(error)
                was_stopped = isinstance(error, Stopped) and error.number != queue.number
                if HydraConfig.get().mode != RunMode.MULTIRUN or was_stopped:
                    sys.exit(code)
                save_failure(code, line)  # the other jobs go on

    try:
        hydra.main(version_base="1.3", config_path=str(conf_folder()), config_name=name)(guarded)()
    except Exception:  # a launcher's library raises what it likes; it is raised again
        summarise_unfinished()
        raise


def _check_grammar(arguments: Sequence[str]) -> None:
    """Check what can be read before Hydra composes: ``CheckFirst`` checks what it composed."""
    check_flags(arguments)
    if parallel.is_torchrun() and any(each in _MULTIRUN for each in arguments):
        raise ConfigError("--multirun must be left out under torchrun: its processes train one run together")
    if all(each in _MULTIRUN for each in arguments if each.startswith("-")):  # others may have arguments of their own
        check_overrides([each for each in arguments if not each.startswith("-")])


def _overrides(arguments: Sequence[str]) -> list[str]:
    """Return what changes the configuration: neither flags nor what they are told, as ``job`` in ``--cfg job``."""
    return [each for each in arguments if not each.startswith("-") and ("=" in each or each.startswith("~"))]


@contextmanager
def folder_of_its_own() -> Iterator[list[str]]:
    """Yield the overrides by which Hydra, in a process that ``torchrun`` has started, writes and logs nothing."""
    folder = tempfile.mkdtemp(prefix="warp_torchrl-")
    try:
        yield [f"hydra.run.dir={folder}", "hydra/job_logging=disabled", "hydra/hydra_logging=disabled"]
    finally:
        shutil.rmtree(folder, ignore_errors=True)


def _without_folder(arguments: Sequence[str]) -> list[str]:
    return [each for each in arguments if not each.startswith("hydra.run.dir=")]


def _with_run_folder(arguments: Sequence[str]) -> list[str]:
    """Let a resumed run write into its own folder."""
    resumed = [each.removeprefix("resume=") for each in arguments if each.startswith("resume=")]
    return [*arguments, *(f"hydra.run.dir={folder}" for folder in resumed if folder != "null")]
