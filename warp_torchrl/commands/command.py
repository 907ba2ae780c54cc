"""The two commands: checks first, works, and ends with one line and an exit code when something fails."""

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

from warp_torchrl.commands.allocation import keep_freed_memory
from warp_torchrl.commands.failure import fail
from warp_torchrl.commands.sweep import SweepSummary, conclude_early, forget_failure, jobs, note_failure
from warp_torchrl.config.compose import (
    Record,
    compose_config,
    conf_folder,
    is_sweep,
    output_folder,
    plain,
    recompose,
    without_targets,
    world_overrides,
)
from warp_torchrl.config.construction import ConfigError
from warp_torchrl.config.grammar import check_flags, check_overrides
from warp_torchrl.config.renamed import renamed_overrides
from warp_torchrl.config.settings import COMPONENTS, settings
from warp_torchrl.evaluation.evaluate import assess, check_assessment
from warp_torchrl.heuristics import HEURISTICS
from warp_torchrl.nearest import did_you_mean
from warp_torchrl.runs import checkpoint as checkpoints
from warp_torchrl.runs import disk
from warp_torchrl.runs.destination import check_free
from warp_torchrl.runs.resumption import resumption
from warp_torchrl.runs.shipped import find_policy
from warp_torchrl.runs.transfer import check_start
from warp_torchrl.training.loop import Training
from warp_torchrl.training.signals import Stopped, obeyed

log = logging.getLogger("warp_torchrl")

_RECORDED = (*COMPONENTS, "scenario")
_MULTIRUN = ("-m", "--multirun")
_NOT_RECORDED = ("resume", "debug", "policy", "hydra")


def train() -> None:
    """Train, as ``python train.py`` and ``warp-train`` do; ends the process with the exit code."""
    _run("train", _train_job)


def evaluate() -> None:
    """Evaluate, as ``python evaluate.py`` and ``warp-evaluate`` do; ends the process with the exit code."""
    _run("evaluate", _evaluate_job)


# The two jobs


def _train_job(config: DictConfig) -> None:
    resumed = config.resume is not None
    folder = Path(config.resume if resumed else HydraConfig.get().runtime.output_dir)
    lock = checkpoints.RunFolderLock(folder)
    try:
        if resumed:
            _resume(folder, _new_total(config, HydraConfig.get().overrides.task))
        else:
            _start(folder, config)
    finally:
        lock.release()


def _start(folder: Path, config: DictConfig) -> None:
    if checkpoints.holds_any(folder):
        raise ConfigError(f"hydra.run.dir: {folder} holds a run already; go on with resume={folder}, or take another")
    if (folder / "evaluation.json").exists():
        raise ConfigError(f"hydra.run.dir: {folder} holds an evaluation, which training would replace; take another")
    disk.replace(folder / "config.yaml", OmegaConf.to_yaml(config, resolve=True))
    record = Record(choices=_choices(), values=_values(config))
    training = Training(settings(plain(config)), record, folder)
    if config.start_from is not None:
        training.start_from(_newest(find_policy(config.start_from)))
    _finish(training, world_overrides(plain(config)))


def _resume(folder: Path, total_frames: Any) -> None:
    run = resumption(folder, total_frames)
    _say_skipped(run.skipped)
    if run.is_finished:
        log.info("%s is finished; total_frames=MORE trains it longer", folder)
        return
    training = Training(run.settings, run.record, folder)
    training.load_state_dict(run.found.training())
    log.info("resumed %s at %d frames", run.found.path, training.frames)
    if run.settings.total_frames != run.total_before:
        # Now and not with the next checkpoint: a run that is killed before it goes on to the new total too.
        disk.replace(folder / "config.yaml", OmegaConf.to_yaml(recompose(run.record), resolve=True))
        training.tell_new_total(run.total_before)
    _finish(training, world_overrides(run.values))


def _finish(training: Training, worlds: Sequence[str]) -> None:
    try:
        training.train()
    finally:
        training.close()
    assess(training.settings, training.run, checkpoints.newest(training.run)[0], worlds)


def _newest(path: str | Path) -> checkpoints.Checkpoint:
    """Return the newest sound checkpoint, and say which were skipped."""
    found, skipped = checkpoints.newest(path)
    _say_skipped(skipped)
    return found


def _say_skipped(skipped: Sequence[str]) -> None:
    for line in skipped:
        log.warning("skipped: %s", line)


def _evaluate_job(config: DictConfig) -> None:
    folder = Path(HydraConfig.get().runtime.output_dir)
    if not config.overwrite:
        check_free(folder, "hydra.run.dir")  # once more: a sweep may have named two jobs' folders alike
    given, name = config.checkpoint, config.policy
    if given is None:
        assess(settings(_without_checkpoint(config)), folder, name, world_overrides(plain(config)))
        return
    found = _newest(find_policy(given))
    values = plain(recompose(found.record(), _of_worlds(HydraConfig.get().overrides.task)))
    assess(settings(values), folder, found, world_overrides(values))


def _of_worlds(overrides: Sequence[str]) -> list[str]:
    """Return the overrides of an evaluation that are not the command's own."""
    return [each for each in overrides if not each.startswith(("checkpoint=", "policy=", "overwrite="))]


# What a run folder records


def _choices() -> dict[str, str]:
    chosen = HydraConfig.get().runtime.choices
    return {group: chosen[group] for group in _RECORDED}


def _values(config: DictConfig) -> dict[str, Any]:
    return {key: value for key, value in without_targets(plain(config)).items() if key not in _NOT_RECORDED}


def _without_checkpoint(config: DictConfig) -> dict[str, Any]:
    return plain(config) | {"checkpoint": plain(compose_config("train"))["checkpoint"]}


# Checks before any work, and what is said when something fails


def _run(name: str, job: Callable[[DictConfig], None]) -> None:
    arguments = renamed_overrides(sys.argv[1:])
    debug = "debug=true" in [each.lower() for each in arguments]
    logging.raiseExceptions = debug  # a log that cannot be written is no second failure
    os.environ["HYDRA_FULL_ERROR"] = "1"  # Hydra's own errors come to fail
    keep_freed_memory()
    with obeyed():
        try:
            _check_first(name, arguments)
            _start_hydra(name, job, arguments, debug)
        except Exception as error:
            sys.exit(fail(error, debug)[0])
        sys.exit(SweepSummary.exit_code)


def _start_hydra(name: str, job: Callable[[DictConfig], None], arguments: list[str], debug: bool) -> None:
    if name == "train":
        arguments = _with_run_folder(arguments)
    sys.argv[1:] = sorted(arguments, key=lambda each: each not in _MULTIRUN)  # Hydra wants -m before the overrides

    def guarded(config: DictConfig) -> None:
        try:
            forget_failure()
            job(config)
        except Exception as error:
            code, line = fail(error, debug)
            if HydraConfig.get().mode != RunMode.MULTIRUN or isinstance(error, Stopped):
                sys.exit(code)
            note_failure(code, line)  # the other jobs go on

    try:
        hydra.main(version_base="1.3", config_path=str(conf_folder()), config_name=name)(guarded)()
    except Exception:
        conclude_early()
        raise


def _check_first(name: str, arguments: Sequence[str]) -> None:
    """Compose and check every job of the command line before the first run folder is made."""
    check_flags(arguments)
    overrides = [each for each in arguments if not each.startswith("-")]
    flags = [each for each in arguments if each.startswith("-")]
    if any(flag not in _MULTIRUN for flag in flags):
        return  # Hydra's own flags (--help, --cfg, --config-dir ...) are Hydra's business
    check_overrides(overrides)
    own = [each for each in overrides if not each.startswith("hydra")]
    sweeps = bool(flags) or is_sweep(name, own)
    listed = jobs(own) if sweeps else [own]
    for job in listed:
        config = compose_config(name, job)
        if name == "train":
            _check_training(config, job)
        else:
            _check_evaluation(config, job)
    if name == "evaluate" and not config.overwrite:
        of_hydra = [each for each in overrides if each.startswith("hydra")]
        key = "hydra.sweep.dir" if sweeps else "hydra.run.dir"
        check_free(output_folder(name, [*listed[0], *of_hydra], sweeps), key)


def _check_training(config: DictConfig, overrides: Sequence[str]) -> None:
    if config.resume is None:
        plan = settings(plain(config))
        plan.check_training()
        if config.start_from is not None:
            check_start(plan, checkpoints.newest(find_policy(config.start_from))[0])
        return
    others = [each for each in overrides if each.split("=")[0] not in ("resume", "debug", "total_frames")]
    if others:
        raise ConfigError(
            f"resume goes on with the folder's own configuration, of which total_frames alone may change; leave out "
            f"{', '.join(others)}"
        )
    folder = Path(str(config.resume))
    if (folder / checkpoints.MANIFEST).exists():
        raise ConfigError(f"resume must be a run folder, got one of its checkpoints: {folder}")
    resumption(folder, _new_total(config, overrides)).settings.check_training()


def _new_total(config: DictConfig, overrides: Sequence[str]) -> Any:
    """Return the total that a resumed run is to go on to, None where none is asked for."""
    return config.total_frames if any(each.startswith("total_frames=") for each in overrides) else None


def _check_evaluation(config: DictConfig, overrides: Sequence[str]) -> None:
    if (config.checkpoint is None) == (config.policy is None):
        raise ConfigError("give either checkpoint=PATH or policy=NAME")
    if config.policy is not None and config.policy not in HEURISTICS:
        hint = did_you_mean(config.policy, HEURISTICS)
        raise ConfigError(f"policy must be one of {', '.join(HEURISTICS)}, got {config.policy}{hint}")
    if not isinstance(config.overwrite, bool):
        raise ConfigError(f"overwrite must be true or false, got {config.overwrite!r}")
    if config.checkpoint is None:
        check_assessment(settings(_without_checkpoint(config)), config.policy)
        return
    found, _ = checkpoints.newest(find_policy(str(config.checkpoint)))
    check_assessment(settings(plain(recompose(found.record(), _of_worlds(overrides)))), found)


def _with_run_folder(arguments: Sequence[str]) -> list[str]:
    """Let a resumed run write into its own folder."""
    resumed = [each.removeprefix("resume=") for each in arguments if each.startswith("resume=")]
    return [*arguments, *(f"hydra.run.dir={folder}" for folder in resumed if folder != "null")]
