"""Checks before any work: each job of a command line is checked as Hydra composed it, before a folder is made."""

import sys
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from dataclasses import fields
from pathlib import Path
from typing import Any, ClassVar

from hydra.conf import HydraConf
from hydra.core.global_hydra import GlobalHydra
from hydra.experimental.callback import Callback
from omegaconf import DictConfig, OmegaConf

from warp_torchrl.commands.failure import fail
from warp_torchrl.commands.sweep import jobs
from warp_torchrl.evaluation.checks import check_evaluation
from warp_torchrl.runs.config.building import BuildOnce
from warp_torchrl.runs.config.compose import HYDRA_ERRORS, check_choices, explain, tidied
from warp_torchrl.runs.config.construction import ConfigError
from warp_torchrl.runs.config.plain_values import plain
from warp_torchrl.runs.destination import check_free
from warp_torchrl.training.checks import check_training
from warp_torchrl.validation import did_you_mean


class CheckFirst(Callback):
    """Checks a command's jobs when Hydra has composed its configuration; a mistake ends the process.

    Attributes:
        build: Builds what is checked, and what the command runs.
    """

    build: ClassVar[BuildOnce] = BuildOnce()

    def on_run_start(self, config: DictConfig, config_name: str | None = None, **kwargs: Any) -> None:
        """Check the one job of a command."""
        with _fatal(config):
            _check(config_name, config)
            if config_name == "evaluate" and not config.overwrite:
                check_free(Path(str(config.hydra.run.dir)), "hydra.run.dir")

    def on_multirun_start(self, config: DictConfig, config_name: str | None = None, **kwargs: Any) -> None:
        """Check every job of a sweep."""
        loader = GlobalHydra.instance().config_loader()
        with _fatal(config):
            for job in jobs(config.hydra.overrides.task):
                try:
                    composed = loader.load_sweep_config(config, job)
                except HYDRA_ERRORS as error:
                    raise explain(error, str(config_name), job) from None
                _check(config_name, composed)
            if config_name == "evaluate" and not config.overwrite:
                check_free(Path(str(config.hydra.sweep.dir)), "hydra.sweep.dir")


@contextmanager
def _fatal(config: DictConfig) -> Iterator[None]:
    """End the process with the exit code of a mistake: Hydra would go on with a warning."""
    try:
        yield
    except Exception as error:
        sys.exit(fail(error, config.get("debug") is True)[0])


def _check(name: str | None, config: DictConfig) -> None:
    overrides = list(config.hydra.overrides.task)
    check_choices(overrides)
    config = tidied(config, overrides)
    values = plain(OmegaConf.masked_copy(config, [str(key) for key in config if key != "hydra"]))
    _check_hydra(list(config.hydra.overrides.hydra))
    if not isinstance(values["debug"], bool):
        raise ConfigError(f"debug must be true or false, got {values['debug']!r}")
    option = config.hydra.runtime.choices.scenario
    if values["scenario"] != option:
        raise ConfigError(f"scenario must be the name of its file, {option}, got {values['scenario']}")
    (check_evaluation if name == "evaluate" else check_training)(values, overrides, CheckFirst.build)


def _check_hydra(overrides: Sequence[str]) -> None:
    """Check that overrides of Hydra's own part name keys that it has: ``+hydra.key`` adds whatever one likes."""
    known = [f"hydra.{each.name}" for each in fields(HydraConf)]
    for override in overrides:
        key = ".".join(override.lstrip("+~").partition("=")[0].split(".")[:2])
        if key.startswith("hydra.") and key not in known:
            raise ConfigError(f"{key} is not a key of the configuration{did_you_mean(key, known)}")
