"""Plug-ins: modules of users that add components, baselines, scenarios and rows of tables.

The command line, a caller and installed entry points name the modules to import; a file that is read never does.
"""

import importlib
import re
import sys
from collections.abc import Iterable, Iterator, Mapping
from functools import cache
from importlib.metadata import entry_points
from pathlib import Path
from types import ModuleType
from typing import Any

from hydra.core.config_search_path import ConfigSearchPath
from hydra.core.plugins import Plugins
from hydra.plugins.search_path_plugin import SearchPathPlugin

from warp_torchrl.runs.config.construction import ConfigError

Plugin = str | ModuleType
"""A plug-in, or its name."""
ENTRY_POINTS = "warp_torchrl.plugins"
"""Group of the entry points by which installed packages are plug-ins."""
_MODULE = re.compile(r"[^\W\d]\w*(\.[^\W\d]\w*)*")
_LOADED: list[str] = []
_FOLDERS: dict[str, Path] = {}
_OPTIONS: dict[str, dict[str, str]] = {}  # class of each option, by group; scenarios have none
_OWNERS: dict[str, str] = {}  # module of what a configuration names by a text
_CHANGES: list[str] = []


def conf_folder() -> Path:
    """Return the folder of the yaml files: inside the package when installed, beside it in a checkout."""
    package = Path(__file__).parents[2]
    inside = package / "conf"
    return inside if inside.is_dir() else package.parent / "conf"


def conf_folders() -> list[Path]:
    """Return the folders of yaml files that plug-ins have."""
    return list(_FOLDERS.values())


def registered(group: str) -> Mapping[str, str]:
    """Return the options of a group that plug-ins have registered, each with the path of its class."""
    return _OPTIONS.get(group, {})


def changes() -> int:
    """Return how often a plug-in has added something: what was composed before is composed again after that."""
    return len(_CHANGES)


# What plug-ins have added


def add_option(group: str, name: str, module: str, target: str = "") -> None:
    """Record an option that a module adds; the module that has added it may do so again.

    Args:
        group: ``reward``, ``scenario`` ...
        name: Of the option.
        module: Its module.
        target: Path of its class; empty for a scenario.

    Raises:
        ValueError: If the name is taken.
    """
    owner = _OWNERS.get(registered(group).get(name) or f"{group}={name}")
    _check_new(group, name, is_again=owner == module)
    _OPTIONS.setdefault(group, {})[name] = target


def own(text: str, module: str) -> None:
    """Record the module of what configurations name by a text."""
    _OWNERS[text] = module
    _CHANGES.append(text)


def _check_new(group: str, name: str, is_again: bool) -> None:
    """Check that no option has a name, but where it is added again."""
    folders = (conf_folder(), *conf_folders())
    if any((folder / group / f"{name}.yaml").exists() for folder in folders) or (
        name in registered(group) and not is_again
    ):
        raise ValueError(f"{group}={name} must have a new name: there is one")


# Who names plug-ins


def load(plugins: Iterable[Plugin] = ()) -> None:
    """Import plug-ins: those that are installed, and those that are named, from the current folder too.

    Args:
        plugins: Modules or their names, of the command line or a caller.

    Raises:
        ConfigError: If there is no such module, or one of its yaml files has the name of one that is there.
        ImportError: If a plug-in's own import fails.
    """
    if isinstance(plugins, str | ModuleType):
        raise ConfigError(f"plugins must be a list, plugins=[{plugins}], got {plugins}")
    listed = [each if isinstance(each, str) else each.__name__ for each in plugins]
    here = str(Path.cwd())
    if listed and here not in sys.path:
        sys.path.append(here)  # as the last: nothing there hides an installed module
    for name in (*_installed(), *listed):
        if name not in _LOADED:
            _load(name)


@cache
def _installed() -> tuple[str, ...]:
    return tuple(each.module for each in entry_points(group=ENTRY_POINTS))


def _load(name: str) -> None:
    if not _MODULE.fullmatch(name):
        raise ConfigError(f"plugins must be names of modules, got {name!r}")
    try:
        module = importlib.import_module(name)
    except ModuleNotFoundError as error:
        if not f"{name}.".startswith(f"{error.name}."):
            raise  # a module that the plug-in imports
        raise ConfigError(f"plugins must be modules, installed or in this folder, and there is no {name}") from None
    for folder in [Path(each) / "conf" for each in getattr(module, "__path__", ())][:1]:
        _add_folder(name, folder)
    _LOADED.append(name)


def _add_folder(name: str, folder: Path) -> None:
    for path in folder.glob("*/*.yaml"):
        _check_new(path.parent.name, path.stem, is_again=False)
    if folder.is_dir():
        _FOLDERS[name] = folder
        _CHANGES.append(str(folder))


class _Folders(SearchPathPlugin):
    """Lets Hydra find the yaml files of plug-ins, after ours."""

    def manipulate_search_path(self, search_path: ConfigSearchPath) -> None:
        for name, folder in _FOLDERS.items():
            search_path.append(name, f"file://{folder}")


Plugins.instance().register(_Folders)


# What a run needs


def needed(values: Mapping[str, Any]) -> list[str]:
    """Return the plug-ins of a configuration: those that it lists, and those that own what it names.

    Args:
        values: Composed, as plain values with the names of classes.

    Raises:
        ConfigError: If it lists one that nobody has imported, as a file may.
    """
    listed = values.get("plugins", [])
    check_loaded(listed)
    texts = {*_texts(values), f"scenario={values.get('scenario')}"}
    modules = {module for text, module in _OWNERS.items() if text in texts}
    file = f"scenario/{values.get('scenario')}.yaml"
    modules |= {name for name, folder in _FOLDERS.items() if (folder / file).exists()}
    return list(dict.fromkeys([*listed, *sorted(map(_plugin_of, modules))]))


def check_loaded(names: Any) -> None:
    """Check that the plug-ins of a configuration are imported.

    Raises:
        ConfigError: If not, with what to list.
    """
    if not (isinstance(names, list | tuple) and all(_MODULE.fullmatch(str(each)) for each in names)):
        raise ConfigError(f"plugins must be a list of modules, plugins=[my_lab], got {names!r:.80}")
    here = {*_LOADED, *_OWNERS.values()}
    missing = [name for name in names if not any(f"{each}.".startswith(f"{name}.") for each in here)]
    if missing:
        raise ConfigError(
            f"plugins=[{','.join(missing)}] must be given: components are of these plug-ins, and no file that is read "
            "imports one"
        )


def _plugin_of(module: str) -> str:
    """Return the plug-in that a module belongs to; the module where nobody has listed one."""
    root = module.partition(".")[0]
    return next((name for name in _LOADED if name.partition(".")[0] == root), module)


def _texts(node: Any) -> Iterator[str]:
    """Yield the keys and texts of a configuration."""
    if isinstance(node, Mapping):
        for key, value in node.items():
            yield key
            yield from _texts(value)
    elif isinstance(node, list | tuple):
        for value in node:
            yield from _texts(value)
    elif isinstance(node, str):
        yield node
