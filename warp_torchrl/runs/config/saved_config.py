"""Configurations of run folders: what is saved of them, and their composition from it.

What is read from a run folder is plain values: classes come from this package and from plug-ins that are imported.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any

from omegaconf import DictConfig, OmegaConf
from omegaconf.errors import OmegaConfBaseException

from warp_torchrl.runs.config.compose import OPTION, compose_config, option_names, option_of
from warp_torchrl.runs.config.construction import (
    COMPONENTS,
    ENVIRONMENT,
    WORLD_KEYS,
    ConfigError,
    component,
    free_mappings,
)
from warp_torchrl.runs.config.plain_values import plain, without_targets
from warp_torchrl.runs.config.plugins import check_loaded
from warp_torchrl.validation import dotted

_DEEPEST = 20
"""How deep what is recorded may be nested; a configuration is 5 deep."""
_LONGEST = 4096
"""Characters of a text that is recorded; a path has no more."""
_OF_NETWORKS = {"mechanics.radio.carries": ("graph", "both")}
"""Values of a scenario's keys that a policy's networks need: another scenario does not change them."""


@dataclass(frozen=True, kw_only=True)
class SavedConfig:
    """A configuration as a run folder keeps it: which option each group had, and every value.

    Attributes:
        choices: Option by group.
        values: Resolved values, without the names of classes.
    """

    choices: dict[str, str] = field(default_factory=dict)
    values: dict[str, Any] = field(default_factory=dict)


def read_saved_config(content: object) -> SavedConfig:
    """Return the configuration that a JSON file holds.

    Args:
        content: From a run folder or a recording: not trusted.

    Raises:
        ValueError: If it is not choices and values, or they are nested too deep or have too long texts.
    """
    choices, values = (content.get(part) if isinstance(content, dict) else None for part in ("choices", "values"))
    if not (isinstance(choices, dict) and isinstance(values, dict)):
        raise ValueError("it must hold choices and values")
    if not all(isinstance(option, str) for option in choices.values()):
        raise ValueError("choices must be names of options")
    _check_bounds([values, list(choices.values())])
    return SavedConfig(choices=choices, values=values)


def _check_bounds(values: Any) -> None:
    level = [values]
    for _ in range(_DEEPEST):
        level = [each for node in level for each in _parts(node)]
        if any(isinstance(each, str) and len(each) > _LONGEST for each in level):
            raise ValueError(f"texts must have at most {_LONGEST} characters")
    if level:
        raise ValueError(f"values must be nested at most {_DEEPEST} deep")


def _parts(node: Any) -> list[Any]:
    if isinstance(node, dict):
        return [*node, *node.values()]
    return node if isinstance(node, list) else []


def environment_config(values: Mapping[str, Any]) -> SavedConfig:
    """Return what a composed configuration, as plain values, says of its environment.

    Raises:
        ConfigError: If a class is none that an option of ours names.
    """
    choices = {group: option_of(group, values[group]["_target_"]) for group in ENVIRONMENT}
    kept = {key: values[key] for key in dict.fromkeys((*WORLD_KEYS, *ENVIRONMENT, "plugins")) if key in values}
    return SavedConfig(choices={"scenario": values["scenario"], **choices}, values=without_targets(kept))


def restore(saved_config: SavedConfig, overrides: Sequence[str] = ()) -> DictConfig:
    """Compose a saved configuration again from the files of this package and of plug-ins, and set its values.

    Its plug-ins must be imported. Values that an override touches are the override's; an override of ``scenario`` takes
    the whole world from that scenario.

    Args:
        saved_config: From a run folder: not trusted.
        overrides: In Hydra's grammar.

    Raises:
        ConfigError: If a choice or a value does not fit, or a plug-in is not imported.
    """
    plugins = saved_config.values.get("plugins", [])
    check_loaded(plugins)
    for group, option in saved_config.choices.items():
        if group not in (*COMPONENTS, "scenario") or not OPTION.fullmatch(str(option)):
            raise ConfigError(f"{group}={option!r} in the run folder is not one of our options")
    touched = ["plugins", *(override.split("=", 1)[0].lstrip("+~") for override in overrides)]
    if "scenario" in touched:
        touched += WORLD_KEYS
    choices = [f"{group}={option}" for group, option in saved_config.choices.items() if group not in touched]
    config = compose_config("train", [*choices, *overrides])
    for path, value in _recorded(saved_config, config, touched).items():
        if "${" in str(value):  # what is recorded was resolved: this one was put there to read what is ours
            raise ConfigError(f"{path} in the run folder must be a plain value, got {value!r}")
        is_touched = any(path == key or _is_in(path, key) for key in touched)
        if is_touched and value not in _OF_NETWORKS.get(path, ()):
            continue
        try:
            OmegaConf.update(config, path, value, merge=False, force_add=path.count(".") > 1)  # into a field's mapping
        except OmegaConfBaseException:
            raise ConfigError(f"{path} in the run folder is not a key of this version's configuration") from None
    config.plugins = list(dict.fromkeys([*plugins, *config.plugins]))
    return config


def completed(saved_config: SavedConfig) -> SavedConfig:
    """Return a saved configuration with every key of this version; newer keys have the value of its run.

    Raises:
        ConfigError: If a choice or a value does not fit.
    """
    return SavedConfig(choices=saved_config.choices, values=without_targets(plain(restore(saved_config))))


def _recorded(saved_config: SavedConfig, config: DictConfig, touched: Sequence[str]) -> dict[str, Any]:
    """Return the saved values by dotted key; a mapping of any keys is one value, unless a key in it is touched.

    So it has the keys that it had, and no others that our files have.
    """
    whole = {key: saved_config.values[key] for key in ("mechanics",) if key in saved_config.values}
    for group in (each for each in COMPONENTS if isinstance(saved_config.values.get(each), Mapping)):
        kind, values = component(config[group]["_target_"]), saved_config.values[group]
        for name in sorted(free_mappings(kind) & values.keys()) if kind is not None else ():
            whole[f"{group}.{name}"] = values[name]
    whole = {path: value for path, value in whole.items() if not any(_is_in(key, path) for key in touched)}
    leaves = dotted(saved_config.values)
    of_networks = {key: leaves[key] for key in _OF_NETWORKS if key in leaves}
    alone = {key: value for key, value in leaves.items() if not any(_is_in(key, path) for path in whole)}
    return {**alone, **whole, **of_networks}


def _is_in(key: str, path: str) -> bool:
    """Return whether a key names something in what a path names."""
    return key.startswith(f"{path}.")


def world_overrides(values: Mapping[str, Any]) -> list[str]:
    """Return how a configuration's worlds differ from those of its scenario, as overrides; files are not named.

    Args:
        values: Plain, with ``_target_``.
    """
    choices = [f"scenario={values['scenario']}"]
    usual = _composed_worlds(choices)
    for group, parts in values.items():
        if group in usual and isinstance(parts, Mapping) and parts.get("_target_") != usual[group].get("_target_"):
            options = {each: _composed_worlds([*choices, f"{group}={each}"])[group] for each in option_names(group)}
            of_its_class = [each for each, other in options.items() if other["_target_"] == parts["_target_"]]
            nearest = min(of_its_class, key=lambda each: sum(options[each].get(key) != parts[key] for key in parts))
            choices.append(f"{group}={nearest}")
            usual = _composed_worlds(choices)
    plain_ones = [name for name, own in values.get("mechanics", {}).items() if not own]  # with their defaults
    added = [f"mechanics.{name}={{}}" for name in plain_ones if name not in usual["mechanics"]]
    usual = dotted(usual)
    changed = [
        f"{path}={value}".replace(" ", "")
        for path, value in map(_of_worlds, dotted({key: values[key] for key in WORLD_KEYS if key in values}).items())
        if (path not in usual or usual[path] != value) and not path.endswith(".path")
    ]
    return choices[1:] + added + changed


def _of_worlds(leaf: tuple[str, Any]) -> tuple[str, Any]:
    """Return a leaf as it is for the worlds: what networks send each other changes none."""
    path, value = leaf
    return (path, {"graph": "none", "both": "map"}.get(value, value)) if path == "mechanics.radio.carries" else leaf


def _composed_worlds(choices: Sequence[str]) -> dict[str, Any]:
    composed = plain(compose_config("train", choices))
    return {key: composed[key] for key in WORLD_KEYS}
