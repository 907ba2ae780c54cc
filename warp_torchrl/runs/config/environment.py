"""Composition of what makes an environment, without learners."""

import re
from collections.abc import Sequence
from typing import Any

from warp_torchrl.runs.config.compose import compose_config
from warp_torchrl.runs.config.construction import ENVIRONMENT, WORLD_KEYS
from warp_torchrl.runs.config.plain_values import plain


def compose_environment(overrides: Sequence[str]) -> dict[str, Any]:
    """Compose what makes an environment, as plain values; overrides of a training compose one.

    Without those no learner is imported, so that a library which learners lack breaks no environment.

    Raises:
        ConfigError: If an override does not fit, in one line.
    """
    if {re.split(r"[=.]", override)[0] for override in overrides} <= {*WORLD_KEYS, *ENVIRONMENT}:
        return plain(compose_config("worlds", overrides))
    from warp_torchrl.runs.config.building import check_keys  # and with it all learners

    config = plain(compose_config("train", overrides))
    check_keys(config)
    return config
