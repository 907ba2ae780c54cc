"""Arguments of ``train.py`` that compose a saved configuration again."""

import re
from collections.abc import Mapping, Sequence
from typing import Any

from warp_torchrl.runs.config.compose import compose_config
from warp_torchrl.runs.config.plain_values import plain
from warp_torchrl.runs.config.saved_config import SavedConfig, restore
from warp_torchrl.validation import dotted

_PLAIN = re.compile(r"[A-Za-z_./][A-Za-z0-9_./-]*")
_BY_NAME = ("observation.channels", "observation.features")
"""What networks may see more or less of, or in another order."""


def arguments_of(
    saved_config: SavedConfig, options: Mapping[str, str], overrides: Sequence[str] = (), left: Sequence[str] = ()
) -> list[str]:
    """Return the arguments that compose a saved configuration with some options and overrides.

    Args:
        saved_config: Of which all other values are.
        options: By group.
        overrides: In Hydra's grammar; they come after the options.
        left: Keys, and groups, that stay as they are without it.

    Raises:
        ConfigError: As of ``restore``.
    """
    given = [*(f"{group}={option}" for group, option in options.items()), *overrides]
    usual = dotted(plain(compose_config("train", given)))
    wanted = dotted(plain(restore(saved_config, overrides))).items()
    return given + [
        f"{'' if path in usual else '+'}{path}={literal(value)}"
        for path, value in wanted
        if path.partition(".")[0] not in left
        and not path.endswith("_target_")
        and (path not in usual or usual[path] != value)
        and (path in usual or not path.startswith("collector."))
    ]


def keys_of_networks(saved_config: SavedConfig, values: Mapping[str, Any]) -> list[str]:
    """Return the arguments that a composed training lacks for the networks of a saved one, and for what these see.

    Args:
        saved_config: Of the training whose networks are wanted.
        values: Composed, as plain values.

    Raises:
        ConfigError: As of ``restore``.
    """
    groups = [group for group in ("observation", "model") if group in saved_config.choices]
    wanted = dotted({group: plain(restore(saved_config))[group] for group in groups})
    here = dotted({group: values[group] for group in groups})
    other = [group for group in groups if here[f"{group}._target_"] != wanted[f"{group}._target_"]]
    given = [f"{group}={saved_config.choices[group]}" for group in other]
    usual = here if not given else here | dotted(plain(compose_config("train", given)))
    return given + [
        f"{path}={literal(value)}"
        for path, value in wanted.items()
        if not path.endswith("_target_") and path not in _BY_NAME and usual.get(path, value) != value
    ]


def literal(value: object) -> str:
    """Return a value in Hydra's grammar."""
    if value is None or isinstance(value, bool):
        return {None: "null", True: "true", False: "false"}[value]
    if isinstance(value, list | tuple):
        return f"[{','.join(map(literal, value))}]"
    text = str(value)
    if not isinstance(value, str) or (_PLAIN.fullmatch(text) and text.lower() not in ("null", "true", "false")):
        return text
    escaped = text.replace("\\", "\\\\").replace("'", "\\'")
    return f"'{escaped}'"
