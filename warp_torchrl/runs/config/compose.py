"""Composition of configurations from the yaml files of ``conf/``.

A component's types, defaults and rules stand in its dataclass and nowhere else. The yaml files name the class, one of
this package's own or of a plug-in's; nothing that is read from a run folder is ever instantiated by name.
"""

import os
import re
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from copy import deepcopy
from dataclasses import fields
from functools import lru_cache
from pathlib import Path
from typing import Any, cast

from hydra import compose, initialize_config_dir
from hydra._internal.sources_registry import SourcesRegistry
from hydra.core.global_hydra import GlobalHydra
from hydra.core.override_parser.overrides_parser import OverridesParser
from hydra.errors import HydraException
from omegaconf import DictConfig, OmegaConf, open_dict
from omegaconf.errors import OmegaConfBaseException

from warp_torchrl.runs.config.construction import (
    COMPONENTS,
    ConfigError,
    UnknownKeyError,
    by_excerpts,
    component,
)
from warp_torchrl.runs.config.defaults import defaults
from warp_torchrl.runs.config.files import FileConfigSource
from warp_torchrl.runs.config.grammar import check_overrides, several_values
from warp_torchrl.runs.config.plain_values import keys_of, plain
from warp_torchrl.runs.config.plugins import changes, conf_folders, needed, registered
from warp_torchrl.runs.config.plugins import conf_folder as conf_folder
from warp_torchrl.validation import did_you_mean

# Hydra's registry refuses a second source of a scheme, unless both have one name: hence the name and the assignment.
SourcesRegistry.instance().types[FileConfigSource.scheme()] = FileConfigSource
OmegaConf.register_new_resolver("pid", os.getpid, replace=True, use_cache=True)  # a sweep's jobs get its own process's
HYDRA_ERRORS = (HydraException, OmegaConfBaseException)
"""What Hydra raises where a configuration has a mistake."""
GROUPS = ("scenario", "experiment")
"""Groups whose options are no classes."""
OPTION = re.compile(r"[A-Za-z0-9_]+")
"""What an option may be called."""
_KEY = re.compile(r"[A-Za-z0-9_.]+")


def compose_config(name: str, overrides: Sequence[str] = ()) -> DictConfig:
    """Compose ``conf/<name>.yaml`` with overrides in Hydra's grammar.

    Raises:
        ConfigError: If an override does not fit, in one line.
    """
    check_choices(overrides)
    return composed(name, overrides)


def composed(name: str, overrides: Sequence[str]) -> DictConfig:
    """Compose as ``compose_config`` does, without its check that each group has one option.

    Raises:
        ConfigError: If an override does not fit, in one line.
    """
    config = _compose(name, overrides)
    try:
        OmegaConf.resolve(config)
    except OmegaConfBaseException as error:
        raise ConfigError(one_line(error)) from None
    return config


@contextmanager
def without_libraries() -> Iterator[None]:
    """Compose and construct by excerpts of modules, within milliseconds, and forget afterwards what was composed.

    Defaults that no excerpt has are missing, and what needs one raises ``OutOfReachError``.
    """
    try:
        with by_excerpts():
            yield
    finally:
        _composed.cache_clear()
        FileConfigSource.forget()


def choices(overrides: Sequence[str]) -> dict[str, str]:
    """Return the option of each group of ``conf/train.yaml`` with overrides that ``compose_config`` takes."""
    GlobalHydra.instance().clear()
    with initialize_config_dir(str(conf_folder()), version_base="1.3"):
        composed = compose("train", overrides=list(overrides), return_hydra_config=True)
    return dict(composed.hydra.runtime.choices)


def check_choices(overrides: Sequence[str]) -> None:
    """Check that each group has one option, by its name.

    Hydra merges lists of options and follows paths; a run folder cannot record those, nor resume from them.

    Raises:
        ConfigError: If not, in one line.
    """
    for override in overrides:
        group, _, option = override.partition("=")
        if group in (*COMPONENTS, "scenario") and not OPTION.fullmatch(option.strip("'\"")):
            several = "; -m sweeps over several" if "," in option else ""
            raise ConfigError(f"{group} must be one of the files of conf/{group}, got {option}{several}")


def _compose(name: str, overrides: Sequence[str]) -> DictConfig:
    try:
        folder = conf_folder()
        config = deepcopy(_composed(folder, _last_change(folder), name, tuple(overrides)))
    except HYDRA_ERRORS as error:
        raise explain(error, name, overrides) from None
    except ValueError as error:
        raise ConfigError(f"{one_line(error)}, in {' '.join(overrides)}") from None
    return tidied(config, overrides)


def tidied(config: DictConfig, overrides: Sequence[str]) -> DictConfig:
    """Return what Hydra composed, without values of options that the overrides replace, and with all plug-ins named.

    ``ignition=file`` in a scenario with ``ignition: {count: 3}`` has no count. What is no field of any option stays, to
    be refused as a mistake.

    Raises:
        ConfigError: If a file names a plug-in that nobody has imported.
    """
    if config.get("plugins") or ("plugins" in config and changes()):
        shown = OmegaConf.masked_copy(config, [str(key) for key in config if key != "hydra"])
        config.plugins = needed(cast("dict[str, Any]", OmegaConf.to_container(shown)))
    given_options = {override.replace("'", "").replace('"', "") for override in overrides}
    given = [override.partition("=")[0].lstrip("+~") for override in overrides]
    for group in (each for each in COMPONENTS if each in given and each in config):
        kind = component(config[group].get("_target_"))
        own = {"_target_"} if kind is None else {"_target_", *(each.name for each in fields(kind))}
        for key in [each for each in config[group] if each not in own and f"{group}.{each}" not in given]:
            if kind is not None and _options_with(f"{group}.{key}"):
                with open_dict(config):
                    del config[group][key]
    if "landscape=array" in given_options and "landscape.size" not in given:
        config.landscape.size = None  # the scenario's would be a window: the whole array is the world
    return config


def _known_keys(name: str, overrides: Sequence[str]) -> list[str]:
    """Return every key of a configuration with the options of the overrides, as far as they can be composed."""
    chosen = tuple(each for each in overrides if each.partition("=")[0] in (*COMPONENTS, *GROUPS))
    for choices in (chosen, ()):
        try:
            config = _composed(conf_folder(), _last_change(conf_folder()), name, choices)
        except HYDRA_ERRORS:
            continue
        return [*keys_of(plain(config)), *GROUPS]
    return []


@lru_cache(maxsize=256)
def _composed(folder: Path, last_change: object, name: str, overrides: tuple[str, ...]) -> DictConfig:
    """Return a composed configuration, once for each state of the files.

    Hydra takes a fifth of a second for it, so options are composed once and values set over a copy, as Hydra does.
    """
    values = [each for each in overrides if _may_name_a_value(folder, each)]
    if values:
        options = tuple(each for each in overrides if each not in values)
        try:
            config = deepcopy(_composed(folder, last_change, name, options))
            for each in OverridesParser.create().parse_overrides(values):
                OmegaConf.update(config, each.key_or_group, each.value(), merge=True)
            return config
        except HYDRA_ERRORS:
            pass  # several values, or a mistake, of which Hydra says more
    return _composed_by_hydra(folder, name, overrides)


def _may_name_a_value(folder: Path, override: str) -> bool:
    """Return whether an override gives a key a value, and neither chooses an option nor adds or removes a key."""
    key, equals, _ = override.partition("=")
    return bool(equals and _KEY.fullmatch(key)) and not key.startswith("hydra.") and not (folder / key).is_dir()


def _composed_by_hydra(folder: Path, name: str, overrides: Sequence[str]) -> DictConfig:
    GlobalHydra.instance().clear()
    with initialize_config_dir(str(folder), version_base="1.3"):
        return compose(name, overrides=list(overrides))


def _last_change(folder: Path) -> tuple[int, int]:
    folders = (folder, *conf_folders())
    return max(path.stat().st_mtime_ns for each in folders for path in (each, *each.glob("**/*"))), changes()


def explain(error: Exception, name: str, overrides: Sequence[str]) -> ConfigError:
    """Return the error that Hydra raised on composing ``conf/<name>.yaml`` as ours, in one line.

    Raises:
        ConfigError: If an override is not of Hydra's grammar.
    """
    check_overrides(overrides)
    unknown = re.match(r"Could not override '([^']*)'", str(error))
    line = one_line(error, _known_keys(name, overrides))
    return UnknownKeyError(line, unknown[1]) if unknown else ConfigError(line)


def one_line(error: Exception, known: Sequence[str] = ()) -> str:
    """Return Hydra's message in one line, with the options if it lists them, and the nearest known key."""
    text = str(error)
    unknown = re.match(r"Could not override '([^']*)'", text)
    if unknown:
        others = _options_with(unknown[1])
        hint = f", but with {' or '.join(others)}" if others else did_you_mean(unknown[1], known)
        return f"{unknown[1]} is not a key of the configuration{hint or '; conf/ and --cfg job show what there is'}"
    missing = re.search(
        r"Could not find '([\w/]+)/([^']*)'.*Available options in '[^']*':(.*)Config search", text, re.S
    )
    if missing:
        options = missing[3].split()
        return f"{missing[1]} must be one of {', '.join(options)}, got {missing[2]}{did_you_mean(missing[2], options)}"
    several = re.match(r"Ambiguous value for argument '(.*)'$", text, re.M)
    if several:
        return several_values(several[1])
    lines = [line.strip() for line in text.splitlines() if line.strip()]
    return " ".join(line for line in lines if not line.startswith(("full_key", "object_type", "Set the environment")))


def _options_with(key: str) -> list[str]:
    """Return the options of a key's group whose files have it."""
    group, _, name = key.partition(".")
    kinds = {option: component(target) for option, target in _targets(group) if group in COMPONENTS and name}
    return [f"{group}={option}" for option, kind in kinds.items() if kind is not None and name in defaults(kind)]


def option_names(group: str) -> list[str]:
    """Return the options of a group: those of the package, and those of plug-ins."""
    files = (path for folder in (conf_folder(), *conf_folders()) for path in sorted((folder / group).glob("*.yaml")))
    return list(dict.fromkeys([*(path.stem for path in files), *registered(group)]))


def option_values(group: str, option: str) -> dict[str, Any]:
    """Return the values of an option: its class's defaults, and what its file says; nothing where there is none."""
    for folder in (conf_folder(), *conf_folders()):
        if (folder / group / f"{option}.yaml").is_file():
            found = FileConfigSource("option", str(folder)).load_config(f"{group}/{option}")
            return plain(cast("DictConfig", found.config))
    kind = component(registered(group).get(option))
    return {} if kind is None else defaults(kind)


def _targets(group: str) -> Iterator[tuple[str, str]]:
    """Yield the options of a group, each with the path of its class: the package's first."""
    for folder in (conf_folder(), *conf_folders()):
        for path in sorted((folder / group).glob("*.yaml")):
            yield path.stem, _target_in(path, path.stat().st_mtime_ns)
        if folder == conf_folder():
            yield from registered(group).items()


@lru_cache(maxsize=1024)
def _target_in(path: Path, changed: int) -> str:
    """Return the path of the class that a yaml file names, once for each state of the file; empty where it has none."""
    return cast("DictConfig", OmegaConf.load(path)).get("_target_", "")


def option_of(group: str, target: str) -> str:
    """Return the first option of a group that names a class; the package's come before those of plug-ins.

    Raises:
        ConfigError: If none does.
    """
    for option, named in _targets(group):
        if named == target:
            return option
    raise ConfigError(
        f"{group}._target_ must be a class that an option of conf/{group} names, or one of a plug-in, got {target}"
    )
