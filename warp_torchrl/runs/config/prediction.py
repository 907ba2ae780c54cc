"""Composition of a prediction."""

from collections.abc import Sequence
from typing import Any

from warp_torchrl.runs.config.compose import compose_config
from warp_torchrl.runs.config.grammar import check_flags
from warp_torchrl.runs.config.plain_values import plain


def compose_prediction(overrides: Sequence[str]) -> dict[str, Any]:
    """Compose ``conf/predict.yaml`` with overrides, as plain values.

    ``ignition`` and ``wind`` are values here, and groups of classes in Hydra's files, so they are read apart.

    Raises:
        ConfigError: If an override does not fit, in one line.
    """
    check_flags(overrides)
    apart = [each for each in overrides if each.startswith(("ignition=", "wind="))]
    values = plain(compose_config("predict", [each for each in overrides if each not in apart]))
    named = (each.partition("=") for each in apart)
    return values | {key: value.strip("'\"") for key, _, value in named}
