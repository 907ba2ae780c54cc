"""Checks of an evaluation before any work."""

from collections.abc import Callable, Mapping, Sequence
from importlib.util import find_spec
from typing import Any, cast

from warp_torchrl.evaluation.evaluate import check_policy
from warp_torchrl.evaluation.picture import PictureKind
from warp_torchrl.heuristics import HEURISTICS
from warp_torchrl.runs import checkpoint as checkpoints
from warp_torchrl.runs.config.construction import ConfigError
from warp_torchrl.runs.config.plain_values import plain
from warp_torchrl.runs.config.run_config import RunConfig
from warp_torchrl.runs.config.saved_config import restore
from warp_torchrl.runs.config.seeds import BEYOND_EVALUATION
from warp_torchrl.runs.policies.find import find_policy
from warp_torchrl.validation import did_you_mean, fit

_MOST_FIRES = 1_000_000
_PICTURE_NEEDS = {"html": ("viser", "live"), "mp4": ("av", "video")}  # module, and the extra that has it


def check_evaluation(
    values: Mapping[str, Any], overrides: Sequence[str], build: Callable[[Mapping[str, Any]], RunConfig]
) -> None:
    """Check a composed evaluation: all of its values, and its policy.

    Args:
        values: Composed, as plain values.
        overrides: Of the command line.
        build: Builds the configuration.

    Raises:
        ConfigError: With key, value and rule.
        CheckpointError: If the policy is not sound.
    """
    checkpoint, policy = values["checkpoint"], values["policy"]
    if (checkpoint is None) == (policy is None):
        raise ConfigError("give either checkpoint=PATH or policy=NAME")
    if policy is not None and policy not in HEURISTICS:
        hint = did_you_mean(policy, HEURISTICS)
        raise ConfigError(f"policy must be one of {', '.join(HEURISTICS)}, got {policy}{hint}")
    if not isinstance(values["overwrite"], bool):
        raise ConfigError(f"overwrite must be true or false, got {values['overwrite']!r}")
    picture_kind(values)
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
    """Return the number of fires of an evaluation's maps, None for no maps.

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


def picture_kind(values: Mapping[str, Any]) -> PictureKind | None:
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
