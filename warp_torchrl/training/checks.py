"""Checks of a training before any work."""

from collections.abc import Callable, Mapping, Sequence
from pathlib import Path
from typing import Any

from warp_torchrl.algorithms import parallel
from warp_torchrl.demonstrations.acts import demonstrations
from warp_torchrl.runs import checkpoint as checkpoints
from warp_torchrl.runs.config.arguments import keys_of_networks
from warp_torchrl.runs.config.building import run_config
from warp_torchrl.runs.config.construction import ConfigError
from warp_torchrl.runs.config.run_config import RunConfig
from warp_torchrl.runs.policies.find import find_policy
from warp_torchrl.runs.resumption import resumption
from warp_torchrl.runs.transfer import OtherNetworksError, check_start

Build = Callable[[Mapping[str, Any]], RunConfig]
"""Builds a configuration of plain values."""


def check_training(values: Mapping[str, Any], overrides: Sequence[str], build: Build = run_config) -> None:
    """Check a composed training: all of its values, and what it begins with or resumes.

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
            _check_start(run_config, values)
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


def _check_start(run_config: RunConfig, values: Mapping[str, Any]) -> None:
    """Check that a training can start from another run.

    Raises:
        CheckpointError: If not; where other networks are the reason, with the keys that this training lacks.
    """
    found = checkpoints.newest(find_policy(values["start_from"]))[0]
    try:
        check_start(run_config, found)
    except OtherNetworksError as refusal:
        try:
            keys = keys_of_networks(found.saved_config(), values)
        except ConfigError:  # of a plug-in that is not imported: what is refused is told all the same
            keys = []
        raise OtherNetworksError(f"{refusal}{'; as there: ' + ' '.join(keys) if keys else ''}") from None


def _check_demonstrations(run_config: RunConfig) -> None:
    """Check that there is what people did for a training to learn from, where it should.

    Raises:
        ConfigError: If there is not, or it does not fit.
    """
    if run_config.imitation.demonstrations is not None:
        demonstrations(run_config, run_config.make_env(1, 0))


def new_total(values: Mapping[str, Any], overrides: Sequence[str]) -> Any:
    """Return the new total of a resumed run, None where none is given."""
    return values["total_frames"] if any(each.startswith("total_frames=") for each in overrides) else None


def check_alone() -> None:
    """Check that ``torchrun`` has not started this process, whose others would each train a run.

    Raises:
        ConfigError: If it has.
    """
    if parallel.is_torchrun():
        raise ConfigError("train starts its processes itself; torchrun starts those of the command: torchrun train.py")
