"""Plug-ins: modules of users that add components, baselines, scenarios and rows of tables.

The command line, a caller and installed entry points name the modules to import; a file that is read never does.
"""

import importlib
import re
import sys
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from dataclasses import MISSING, fields, is_dataclass
from functools import cache
from importlib.metadata import entry_points
from pathlib import Path
from types import ModuleType
from typing import Any, TypeVar, cast

from hydra.core.config_search_path import ConfigSearchPath
from hydra.core.config_store import ConfigStore
from hydra.core.override_parser.overrides_parser import OverridesParser
from hydra.core.plugins import Plugins
from hydra.plugins.search_path_plugin import SearchPathPlugin
from omegaconf import OmegaConf

from warp_torchrl.env.metrics import metric
from warp_torchrl.env.observation import channel, number, picture_channel, state_plane
from warp_torchrl.env.reward.terms import term
from warp_torchrl.heuristics import heuristic
from warp_torchrl.runs.config.construction import COMPONENTS, ConfigError, add_component
from warp_torchrl.runs.config.defaults import option_node
from warp_torchrl.runs.config.grammar import check_overrides
from warp_torchrl.validation import did_you_mean
from warp_torchrl.world.mechanics.table import mechanic
from warp_torchrl.world.team.abilities import ability

Added = TypeVar("Added", bound=Callable[..., Any])
Plugin = str | ModuleType
"""A plug-in, or its name."""
ENTRY_POINTS = "warp_torchrl.plugins"
"""Group of the entry points by which installed packages are plug-ins."""
_NAMED: dict[str, Callable[..., Any]] = {"heuristic": heuristic, "mechanic": mechanic, "term": term, "ability": ability}
"""Tables whose rows have a name that is given."""
_FUNCTIONS: dict[str, Callable[..., Any]] = {
    "channel": channel,
    "number": number,
    "picture_channel": picture_channel,
    "state_plane": state_plane,
    "metric": metric,
}
"""Tables whose rows have the name of their function."""
KINDS = (*COMPONENTS, *_NAMED, *_FUNCTIONS)
"""What ``register`` takes."""
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


# What a plug-in calls


def register(kind: str, name: str | None = None, **options: Any) -> Callable[[Added], Added]:
    """Return what adds a class or function of a plug-in under a name.

        @register("reward")
        @dataclass(frozen=True, kw_only=True)
        class CalmFire(Reward):  # then reward=calm_fire chooses it, and reward.KEY=VALUE sets its fields

    Args:
        kind: A group of the configuration, ``reward``, ``wind``, ``fire``, ``algorithm`` ...; or ``heuristic``,
            ``mechanic``, ``term``, ``ability``, ``channel``, ``number``, ``picture_channel``, ``state_plane``,
            ``metric``, a table of functions or classes.
        name: Of the option or the row; None: the class's in snake case, or the function's.
        options: Of a function's row, ``high=250`` of a channel.

    Raises:
        ValueError: If the kind is unknown, the name is taken, or it is no frozen dataclass where it should be.
    """
    if kind not in KINDS:
        raise ValueError(f"kind must be one of {', '.join(KINDS)}, got {kind!r}{did_you_mean(kind, KINDS)}")
    if options and kind not in _FUNCTIONS:
        raise ValueError(f"{kind} takes no options, got {', '.join(options)}")

    def add(made: Added) -> Added:
        called = name or (_snake(made.__name__) if isinstance(made, type) else made.__name__)
        if kind in COMPONENTS:
            _add_option(kind, called, made)
        elif kind in _NAMED:
            _NAMED[kind](called)(made)
        elif name in (None, made.__name__):
            _FUNCTIONS[kind](**options)(made)
        else:
            raise ValueError(f"{kind} must have the name of its function, {made.__name__}, got {name}")
        _own(_path(made) if kind in COMPONENTS else called, made.__module__)
        return made

    return add


def add_scenario(name: str, overrides: Sequence[str]) -> None:
    """Add a scenario that differs from the defaults of worlds by overrides in the command line's grammar.

        add_scenario("ridge", ["wind=gusts", "wind.speed=8", "landscape.size=24", "team.n_agents=3"])

    Raises:
        ConfigError: If an override cannot be read.
        ValueError: If the name is taken.
    """
    module = sys._getframe(1).f_globals["__name__"]
    check_overrides(overrides)
    chosen, node = [], OmegaConf.create({"scenario": name})
    for each in OverridesParser.create().parse_overrides(list(overrides)):
        if each.key_or_group in COMPONENTS:
            chosen.append({f"override /{each.key_or_group}": each.value()})
        else:
            OmegaConf.update(node, each.key_or_group, each.value(), force_add=True)
    _check_new("scenario", name, _OWNERS.get(f"scenario={name}") == module)
    own = cast("dict[str, Any]", OmegaConf.to_container(node))
    values = {**({"defaults": chosen} if chosen else {}), **own}
    ConfigStore.instance().store(name, values, group="scenario", package="_global_", provider=module)
    _OPTIONS.setdefault("scenario", {})[name] = ""
    _own(f"scenario={name}", module)


def _add_option(group: str, name: str, kind: Any) -> None:
    if not (isinstance(kind, type) and is_dataclass(kind) and kind.__dataclass_params__.frozen):  # type: ignore[attr-defined]
        raise ValueError(f"{group} must be a frozen dataclass, got {kind!r}")
    for each in fields(kind):
        if each.init and each.default is MISSING and each.default_factory is MISSING:
            raise ValueError(f"{group} must have a default for every field, and {kind.__name__}.{each.name} has none")
    _check_new(group, name, _OWNERS.get(registered(group).get(name, "")) == kind.__module__)
    add_component(_path(kind), kind)
    ConfigStore.instance().store(name, option_node(kind), group=group, provider=kind.__module__)
    _OPTIONS.setdefault(group, {})[name] = _path(kind)


def _check_new(group: str, name: str, is_again: bool) -> None:
    """Check that no option has a name; the module that has registered it may do so again."""
    folders = (conf_folder(), *conf_folders())
    if any((folder / group / f"{name}.yaml").exists() for folder in folders) or (
        name in registered(group) and not is_again
    ):
        raise ValueError(f"{group}={name} must have a new name: there is one")


def _path(kind: Any) -> str:
    return f"{kind.__module__}.{kind.__qualname__}"


def _snake(name: str) -> str:
    return re.sub(r"(?<=[a-z0-9])(?=[A-Z])|(?<=[A-Z])(?=[A-Z][a-z])", "_", name).lower()


def _own(text: str, module: str) -> None:
    _OWNERS[text] = module
    _CHANGES.append(text)


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
