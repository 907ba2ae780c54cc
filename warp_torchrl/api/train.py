"""Trainings from Python."""

import os
from collections.abc import Sequence
from datetime import datetime
from pathlib import Path
from typing import Any

from warp_torchrl.api.keywords import as_overrides, check_list
from warp_torchrl.runs.config.building import BuildOnce
from warp_torchrl.runs.config.compose import choices, compose_config
from warp_torchrl.runs.config.construction import COMPONENTS, ConfigError
from warp_torchrl.runs.config.grammar import listed_plugins
from warp_torchrl.runs.config.plain_values import plain
from warp_torchrl.runs.config.plugins import Plugin, load
from warp_torchrl.system.modes import apart
from warp_torchrl.training.callbacks import Callbacks
from warp_torchrl.training.checks import check_alone, check_training, new_total
from warp_torchrl.training.run import Run, train_composed

_RECORDED = (*COMPONENTS, "scenario")


@apart
def train(
    overrides: Sequence[str] = (),
    *,
    callbacks: Sequence[object] = (),
    folder: str | Path | None = None,
    plugins: Sequence[Plugin] = (),
    **keywords: Any,
) -> Run:
    """Train a team, evaluate it, and return the run.

    It leaves signals to the caller. An interrupt ends it with the last checkpoint, from which
    ``train(["resume=FOLDER"])`` resumes.

    Args:
        overrides: In the command line's grammar, ``["scenario=single", "algorithm=ippo", "total_frames=200_000"]``.
        callbacks: Objects with some of ``on_batch``, ``on_evaluation``, ``on_checkpoint`` and ``on_end``; see
            ``warp_torchrl.training.callbacks.HOOKS``.
        folder: The run folder; None makes one in ``outputs``.
        plugins: As for ``make_env``.
        keywords: Further overrides, plain values by key: ``scenario="single"``, ``team=dict(n_agents=3)``. A component
            must be an option, which the run folder can record.

    Returns:
        The run, with its evaluation.

    Raises:
        ConfigError: A ``ValueError``, with key, value and rule.
        CheckpointError: If what it resumes or begins with is not sound.
        NumericalFailure: If a reward, loss or gradient is not finite.
        RunFolderInUse: If another process trains in the folder.
        OSError: If the folder cannot be written.
    """
    check_list("overrides", overrides)
    Callbacks(callbacks)  # checks them before any work
    load([*plugins, *listed_plugins(overrides)])
    further, objects = as_overrides(keywords)
    if objects:
        key, component = next(iter(objects.items()))
        raise ConfigError(f"{key} must be an option and plain values, which a run folder records, got {component!r}")
    check_alone()
    overrides, build = [*overrides, *further], BuildOnce()
    config = compose_config("train", overrides)
    check_training(plain(config), overrides, build)
    if config.resume is not None:
        if folder is not None:
            raise ConfigError(f"folder must be left out with resume={config.resume}, which names it, got {folder}")
        path = Path(config.resume)
    else:
        path = Path(folder) if folder is not None else Path(f"outputs/{datetime.now():%Y-%m-%d/%H-%M-%S}-{os.getpid()}")
    recorded = {group: option for group, option in choices(overrides).items() if group in _RECORDED}
    total = new_total(plain(config), overrides)
    return train_composed(config, recorded, path, total_frames=total, callbacks=callbacks, build=build)
