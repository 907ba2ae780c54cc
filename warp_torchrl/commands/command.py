"""The commands train and evaluate. They check everything first, and end a failure with one line and an exit code."""

import logging
import os
import sys
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import Any

import hydra
from hydra.core.hydra_config import HydraConfig
from hydra.types import RunMode
from omegaconf import DictConfig, OmegaConf

from warp_torchrl.algorithms import parallel
from warp_torchrl.commands.checks import CheckFirst, map_fires, new_total, of_worlds, picture, without_checkpoint
from warp_torchrl.commands.failure import fail
from warp_torchrl.commands.following import FOLLOWING, folder_of_its_own, follow_training
from warp_torchrl.commands.queue import queued
from warp_torchrl.commands.sweep import SweepSummary, remove_failure, save_failure, summarise_unfinished
from warp_torchrl.evaluation.evaluate import evaluate_policy
from warp_torchrl.runs import checkpoint as checkpoints
from warp_torchrl.runs.config.building import BuildOnce
from warp_torchrl.runs.config.compose import (
    HYDRA_ERRORS,
    conf_folder,
    explain,
    option_of,
    plain,
    tidied,
    without_targets,
)
from warp_torchrl.runs.config.construction import COMPONENTS, ConfigError
from warp_torchrl.runs.config.grammar import check_flags, check_overrides, flags_first, listed_plugins
from warp_torchrl.runs.config.plugins import load, registered
from warp_torchrl.runs.config.saved_config import SavedConfig, restore, world_overrides
from warp_torchrl.runs.destination import check_free
from warp_torchrl.runs.policies.find import find_policy
from warp_torchrl.runs.resumption import Resumption, is_run_of, resumption
from warp_torchrl.system import disk
from warp_torchrl.system.lock import RunFolderLock
from warp_torchrl.system.malloc import keep_freed_memory
from warp_torchrl.system.parent import SECONDS_TO_SAVE, end_with, is_orphaned
from warp_torchrl.system.signals import Stopped, exit_on_signal
from warp_torchrl.training.loop import Training

log = logging.getLogger("warp_torchrl")

_RECORDED = (*COMPONENTS, "scenario")
_MULTIRUN = ("-m", "--multirun")
_NOT_RECORDED = ("resume", "debug", "policy", "hydra")


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
    resumed = config.resume is not None
    folder = Path(config.resume if resumed else HydraConfig.get().runtime.output_dir)
    lock = RunFolderLock(folder)
    try:
        if resumed:
            _resume(folder, new_total(config, HydraConfig.get().overrides.task))
        else:
            _start(folder, config)
    finally:
        lock.release()


def _start(folder: Path, config: DictConfig) -> None:
    if checkpoints.holds_any(folder):
        _go_on(folder, config)
        return
    if (folder / "evaluation.json").exists():
        raise ConfigError(f"hydra.run.dir: {folder} holds an evaluation, which training would replace; take another")
    run_config = CheckFirst.build(plain(config)).settled()
    config.processes = run_config.processes
    disk.replace(folder / "config.yaml", OmegaConf.to_yaml(config, resolve=True))
    saved_config = SavedConfig(choices=_choices(config), values=_values(config))
    with parallel.processes(run_config.n_processes(), plain(config), FOLLOWING):
        training = Training(run_config, saved_config, folder)
        if config.start_from is not None:
            training.start_from(_newest(find_policy(config.start_from)))
        _train(training)
    _evaluate(training, world_overrides(plain(config)))


def _go_on(folder: Path, config: DictConfig) -> None:
    """Resume the run of this very configuration: a queue that has stopped a job gives it the same command line again.

    Raises:
        ConfigError: If the folder holds another run, or this one has come to its end and is no job of a sweep.
    """
    is_same = is_run_of(folder, OmegaConf.to_yaml(config, resolve=True))
    run = resumption(folder, build=CheckFirst.build) if is_same else None
    if run is None or (run.is_finished and HydraConfig.get().mode != RunMode.MULTIRUN):
        raise ConfigError(f"hydra.run.dir: {folder} holds a run already; go on with resume={folder}, or take another")
    _resume_from(folder, run)


def _resume(folder: Path, total_frames: Any) -> None:
    _resume_from(folder, resumption(folder, total_frames, CheckFirst.build))


def _resume_from(folder: Path, run: Resumption) -> None:
    _say_skipped(run.skipped)
    if run.is_finished:
        log.info("%s is finished; total_frames=MORE trains it longer", folder)
        return
    with parallel.processes(run.run_config.n_processes(), run.values, FOLLOWING):
        training = Training(run.run_config, run.saved_config, folder)
        training.load_state_dict(run.found.training())
        log.info("resumed %s at %d frames", run.found.path, training.frames)
        if run.run_config.total_frames != run.total_before:
            # Before the next checkpoint: a run that is killed now must resume with the new total too.
            disk.replace(folder / "config.yaml", OmegaConf.to_yaml(restore(run.saved_config), resolve=True))
            training.log_new_total(run.total_before)
        _train(training)
    _evaluate(training, world_overrides(run.values))


def _train(training: Training) -> None:
    try:
        training.train()
    finally:
        training.close()


def _evaluate(training: Training, worlds: Sequence[str]) -> None:
    evaluate_policy(training.run_config, training.run, checkpoints.newest(training.run)[0], worlds)


def _newest(path: str | Path) -> checkpoints.Checkpoint:
    """Return the newest sound checkpoint, and log the skipped ones."""
    found, skipped = checkpoints.newest(path)
    _say_skipped(skipped)
    return found


def _say_skipped(skipped: Sequence[str]) -> None:
    for line in skipped:
        log.warning("skipped: %s", line)


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
    fires, kind = map_fires(plain(config)), picture(plain(config))
    if given is None:
        values = without_checkpoint(plain(config))
        evaluate_policy(CheckFirst.build(values), folder, name, world_overrides(values), fires, kind)
        return
    found = _newest(find_policy(given))
    values = plain(restore(found.saved_config(), of_worlds(HydraConfig.get().overrides.task)))
    evaluate_policy(CheckFirst.build(values), folder, found, world_overrides(values), fires, kind)


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


def _values(config: DictConfig) -> dict[str, Any]:
    return {key: value for key, value in without_targets(plain(config)).items() if key not in _NOT_RECORDED}


# The start of a command, and errors


def _run(name: str, job: Callable[[DictConfig], None]) -> None:
    arguments = sys.argv[1:]
    debug = "debug=true" in [each.lower() for each in arguments]
    logging.raiseExceptions = debug  # a full disk must not print a second error
    os.environ["HYDRA_FULL_ERROR"] = "1"  # Hydra then raises its errors instead of printing them
    keep_freed_memory()
    CheckFirst.build = BuildOnce()
    if not debug:
        logging.getLogger("torchrl").setLevel(logging.WARNING)  # it prints a line for each of its buffers
    if parallel.is_torchrun():
        end_with(os.getppid(), SECONDS_TO_SAVE)
    with exit_on_signal():
        try:
            _check_grammar(arguments)
            load(listed_plugins(arguments))
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


def _without_folder(arguments: Sequence[str]) -> list[str]:
    return [each for each in arguments if not each.startswith("hydra.run.dir=")]


def _with_run_folder(arguments: Sequence[str]) -> list[str]:
    """Let a resumed run write into its own folder."""
    resumed = [each.removeprefix("resume=") for each in arguments if each.startswith("resume=")]
    return [*arguments, *(f"hydra.run.dir={folder}" for folder in resumed if folder != "null")]
