"""Help on keys: ``--help`` of train and evaluate, and the command ``warp keys``."""

import re
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import MISSING, fields
from typing import Any

from warp_torchrl.commands.program import run_program, tell
from warp_torchrl.runs.config.compose import compose_config, conf_folder, option_names
from warp_torchrl.runs.config.construction import COMPONENTS, ConfigError, component
from warp_torchrl.runs.config.key_help import first_paragraph, key_help
from warp_torchrl.runs.config.plain_values import plain
from warp_torchrl.runs.config.run_config import RunConfig
from warp_torchrl.validation import did_you_mean
from warp_torchrl.world.mechanics.table import mechanics
from warp_torchrl.world.world import World

USAGE = "warp keys [GROUP ...]"
ASKS = ("--help", "-h")
"""Flags that ask for it."""
_BUILT = {each.name for each in fields(RunConfig) if each.default is each.default_factory is MISSING}
PARTS = {*_BUILT, *COMPONENTS, "mechanics"}
"""Fields of a run and of its world that are components, or made of them, and no values."""
_OWN_KEY = re.compile(r"(?m)^(\w+): +(\S+) +# (.+)$")


def run_help(name: str, overrides: Sequence[str]) -> str:
    """Return the help of ``train`` or ``evaluate`` for the options that overrides choose.

    Raises:
        ConfigError: If an override does not fit.
    """
    values = plain(compose_config(name, overrides))
    parts = [
        f"usage: warp {name} [KEY=VALUE ...]\n       warp {name} -m KEY=VALUE,VALUE ...    a job for each value",
        "Keys are shown with the values that they have here. Options have keys of their own: "
        f"warp {name} --help algorithm=dqn\n--cfg job prints the values alone.",
        f"{name}\n{_own_keys(name)}",
        f"the run\n{key_help(RunConfig, left_out=PARTS, values=values)}",
        f"the world of a scenario\n{key_help(World, left_out=PARTS, values=values)}",
        *(f"{group}={{{','.join(option_names(group))}}}" for group in ("scenario", "experiment")),
        *(_group_help(group, values) for group in COMPONENTS),
        *_mechanics_help(),
    ]
    return "\n\n".join(parts)


def main(arguments: Sequence[str] | None = None) -> int:
    """Print the keys of each option of the groups that the command line names, and return the exit code."""
    about = f"usage: {USAGE}\n\nGROUP: {', '.join(COMPONENTS)}, mechanics; all of them where none is named."
    return run_program(arguments, about, lambda given: tell(keys_help(given or [*COMPONENTS, "mechanics"])))


def keys_help(groups: Sequence[str]) -> str:
    """Return the keys of each option of groups, with their defaults.

    Raises:
        ConfigError: If there is no such group.
    """
    return "\n\n".join(part for group in groups for part in _options_help(group))


def _options_help(group: str) -> Iterator[str]:
    """Yield a part for each class of a group."""
    if group == "mechanics":
        yield from _mechanics_help()
        return
    if group not in COMPONENTS:
        known = (*COMPONENTS, "mechanics")
        raise ConfigError(f"GROUP must be one of {', '.join(known)}, got {group}{did_you_mean(group, known)}")
    options: dict[type, list[str]] = {}
    for option in option_names(group):
        kind = component(plain(compose_config("train", [f"{group}={option}"]))[group].get("_target_"))
        if kind is not None:
            options.setdefault(kind, []).append(f"{group}={option}")
    for kind, names in options.items():
        yield "\n".join(filter(None, (f"{', '.join(names)}: {first_paragraph(kind)}", key_help(kind, f"{group}."))))


def _mechanics_help() -> Iterator[str]:
    for name, kind in sorted(mechanics().items()):
        prefix = f"mechanics.{name}"
        yield f"{prefix}: {first_paragraph(kind)}\n{key_help(kind, f'{prefix}.')}"


def _own_keys(name: str) -> str:
    """Return the help on keys that stand in ``conf/<name>.yaml`` alone."""
    files = ("train", name) if name == "evaluate" else (name,)
    lines = [line for each in files for line in _commented((conf_folder() / f"{each}.yaml").read_text("utf-8"))]
    return "\n".join(lines)


def _commented(text: str) -> Iterator[str]:
    for key, value, words in _OWN_KEY.findall(text):
        yield f"  {key}={value}\n      {words}"


def _group_help(group: str, values: Mapping[str, Any]) -> str:
    kind = component(values[group].get("_target_")) if group in values else None
    options = f"{group}={{{','.join(option_names(group))}}}"
    if kind is None:
        return options
    return "\n".join(filter(None, (options, f"  {first_paragraph(kind)}", key_help(kind, f"{group}.", values=values))))
