"""Checks before any work: each job of a command line is checked as Hydra composed it, before a folder is made."""

import sys
from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from dataclasses import fields
from importlib.util import find_spec
from pathlib import Path
from typing import Any, ClassVar, cast

from hydra.conf import HydraConf
from hydra.core.global_hydra import GlobalHydra
from hydra.experimental.callback import Callback
from omegaconf import DictConfig, OmegaConf

from warp_torchrl.commands.failure import fail
from warp_torchrl.commands.sweep import jobs
from warp_torchrl.demonstrations.acts import demonstrations
from warp_torchrl.evaluation.evaluate import check_policy
from warp_torchrl.evaluation.picture import PictureKind
from warp_torchrl.heuristics import HEURISTICS
from warp_torchrl.runs import checkpoint as checkpoints
from warp_torchrl.runs.config.building import BuildOnce, run_config
from warp_torchrl.runs.config.compose import HYDRA_ERRORS, check_choices, explain, plain, tidied
from warp_torchrl.runs.config.construction import ConfigError
from warp_torchrl.runs.config.run_config import RunConfig
from warp_torchrl.runs.config.saved_config import restore
from warp_torchrl.runs.config.seeds import BEYOND_EVALUATION
from warp_torchrl.runs.destination import check_free
from warp_torchrl.runs.policies.find import find_policy
from warp_torchrl.runs.resumption import resumption
from warp_torchrl.runs.transfer import check_start
from warp_torchrl.validation import did_you_mean, fit

Build = Callable[[Mapping[str, Any]], RunConfig]
"""Builds a configuration of plain values."""
_MOST_FIRES = 1_000_000
_PICTURE_NEEDS = {"html": ("viser", "live"), "mp4": ("av", "video")}  # module, and the extra that has it


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
    (_check_evaluation if name == "evaluate" else check_training)(values, overrides, CheckFirst.build)


def _check_hydra(overrides: Sequence[str]) -> None:
    """Check that overrides of Hydra's own part name keys that it has: ``+hydra.key`` adds whatever one likes."""
    known = [f"hydra.{each.name}" for each in fields(HydraConf)]
    for override in overrides:
        key = ".".join(override.lstrip("+~").partition("=")[0].split(".")[:2])
        if key.startswith("hydra.") and key not in known:
            raise ConfigError(f"{key} is not a key of the configuration{did_you_mean(key, known)}")


def check_training(values: Mapping[str, Any], overrides: Sequence[str], build: Build = run_config) -> None:
    """Check a training as it is composed: all of its values, and what it begins with or resumes.

    Args:
        values: Composed, as plain values.
        overrides: Of the command line.
        build: Builds the configuration.

    Raises:
        ConfigError: With key, value and rule.
        CheckpointError: If what it begins with or resumes is not sound.
    """
    if values["resume"] is None:
        run_config = build(values)
        run_config.check_training()
        _check_demonstrations(run_config)
        if values["start_from"] is not None:
            check_start(run_config, checkpoints.newest(find_policy(values["start_from"]))[0])
        return
    others = [each for each in overrides if each.split("=")[0] not in ("resume", "debug", "plugins", "total_frames")]
    if others:
        raise ConfigError(
            f"resume goes on with the folder's own configuration, of which total_frames alone may change; leave out "
            f"{', '.join(others)}"
        )
    folder = Path(str(values["resume"]))
    if (folder / checkpoints.MANIFEST).exists():
        raise ConfigError(f"resume must be a run folder, got one of its checkpoints: {folder}")
    run_config = resumption(folder, new_total(values, overrides), build).run_config
    run_config.check_training()
    _check_demonstrations(run_config)


def _check_demonstrations(run_config: RunConfig) -> None:
    """Check that there is what people did for a training to learn from, where it should.

    Raises:
        ConfigError: If there is not, or it does not fit.
    """
    if run_config.imitation.demonstrations is not None:
        demonstrations(run_config, run_config.make_env(1, 0))


def new_total(values: Mapping[str, Any], overrides: Sequence[str]) -> Any:
    """Return the total that a resumed run is to go on to, None where none is asked for."""
    return values["total_frames"] if any(each.startswith("total_frames=") for each in overrides) else None


def _check_evaluation(values: Mapping[str, Any], overrides: Sequence[str], build: Build) -> None:
    checkpoint, policy = values["checkpoint"], values["policy"]
    if (checkpoint is None) == (policy is None):
        raise ConfigError("give either checkpoint=PATH or policy=NAME")
    if policy is not None and policy not in HEURISTICS:
        hint = did_you_mean(policy, HEURISTICS)
        raise ConfigError(f"policy must be one of {', '.join(HEURISTICS)}, got {policy}{hint}")
    if not isinstance(values["overwrite"], bool):
        raise ConfigError(f"overwrite must be true or false, got {values['overwrite']!r}")
    picture(values)
    fires = map_fires(values)
    if fires is None and any(each.startswith("maps_fires=") for each in overrides):
        raise ConfigError(f"maps_fires must come with maps=true, got {values['maps_fires']} alone")
    if checkpoint is None:
        run_config, found = build(without_checkpoint(values)), policy
    else:
        found, _ = checkpoints.newest(find_policy(str(checkpoint)))
        run_config = build(plain(restore(found.saved_config(), of_worlds(overrides))))
    check_maps(run_config, fires)
    check_policy(run_config, found)


def map_fires(values: Mapping[str, Any]) -> int | None:
    """Return how many fires the maps of an evaluation have, None where none are asked for.

    Raises:
        ConfigError: If ``maps`` is no truth or ``maps_fires`` no such number, or what writes maps is not installed.
    """
    maps, fires = values["maps"], values["maps_fires"]
    if not isinstance(maps, bool):
        raise ConfigError(f"maps must be true or false, got {maps!r}")
    if type(fires) is not int or not 2 <= fires <= _MOST_FIRES:
        raise ConfigError(f"maps_fires must be a whole number in 2..{_MOST_FIRES}, got {fires!r}")
    missing = [name for name in ("matplotlib", "rasterio") if maps and find_spec(name) is None]
    if missing:
        raise ConfigError(f'maps needs {" and ".join(missing)}, not installed: pip install "warp_torchrl[figures,gis]"')
    return fires if maps else None


def picture(values: Mapping[str, Any]) -> PictureKind | None:
    """Return as what an evaluation writes its first fire, None where it writes no picture.

    Raises:
        ConfigError: If ``picture`` is nothing of the kind, or what writes it is not installed.
    """
    try:
        kind = cast(PictureKind | None, fit(values["picture"], PictureKind | None, "picture"))
    except ValueError as error:
        raise ConfigError(str(error)) from None
    module, extra = _PICTURE_NEEDS.get(str(kind), ("", ""))
    if module and find_spec(module) is None:
        raise ConfigError(f'picture={kind} needs {module}, not installed: pip install "warp_torchrl[{extra}]"')
    return kind


def check_maps(run_config: RunConfig, fires: int | None) -> None:
    """Check that the fires of the maps have seeds that no training has.

    Raises:
        ConfigError: If the last one's is beyond those of evaluations.
    """
    highest = BEYOND_EVALUATION - (fires or 0)
    if run_config.evaluation.first_seed > highest:
        first = run_config.evaluation.first_seed
        raise ConfigError(f"evaluation.first_seed must be in 0..{highest} for {fires} fires of the maps, got {first}")


def of_worlds(overrides: Sequence[str]) -> list[str]:
    """Return the overrides of an evaluation that are not the command's own."""
    own = ("checkpoint=", "policy=", "overwrite=", "maps=", "maps_fires=", "picture=")
    return [each for each in overrides if not each.startswith(own)]


def without_checkpoint(values: Mapping[str, Any]) -> dict[str, Any]:
    """Return a configuration of an evaluation without its ``checkpoint``, which names one and does not make any."""
    return {key: value for key, value in values.items() if key != "checkpoint"}
