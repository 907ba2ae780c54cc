"""Registration: components, baselines, scenarios and rows of tables that plug-ins add."""

import re
import sys
from collections.abc import Callable, Sequence
from dataclasses import MISSING, fields, is_dataclass
from typing import Any, TypeVar, cast

from hydra.core.config_store import ConfigStore
from hydra.core.override_parser.overrides_parser import OverridesParser
from omegaconf import OmegaConf

from warp_torchrl.env.metrics import metric
from warp_torchrl.env.observation import channel, number, picture_channel, state_plane
from warp_torchrl.env.reward.terms import term
from warp_torchrl.heuristics import heuristic
from warp_torchrl.runs.config.construction import COMPONENTS, add_component
from warp_torchrl.runs.config.defaults import option_node
from warp_torchrl.runs.config.grammar import check_overrides
from warp_torchrl.runs.config.plugins import add_option, own
from warp_torchrl.validation import did_you_mean
from warp_torchrl.world.mechanics.table import mechanic
from warp_torchrl.world.team.abilities import ability

Added = TypeVar("Added", bound=Callable[..., Any])
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
        own(_path(made) if kind in COMPONENTS else called, made.__module__)
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
    add_option("scenario", name, module)
    values = {**({"defaults": chosen} if chosen else {}), **cast("dict[str, Any]", OmegaConf.to_container(node))}
    ConfigStore.instance().store(name, values, group="scenario", package="_global_", provider=module)
    own(f"scenario={name}", module)


def _add_option(group: str, name: str, kind: Any) -> None:
    if not (isinstance(kind, type) and is_dataclass(kind) and kind.__dataclass_params__.frozen):  # type: ignore[attr-defined]
        raise ValueError(f"{group} must be a frozen dataclass, got {kind!r}")
    for each in fields(kind):
        if each.init and each.default is MISSING and each.default_factory is MISSING:
            raise ValueError(f"{group} must have a default for every field, and {kind.__name__}.{each.name} has none")
    add_option(group, name, kind.__module__, _path(kind))
    add_component(_path(kind), kind)
    ConfigStore.instance().store(name, option_node(kind), group=group, provider=kind.__module__)


def _path(kind: Any) -> str:
    return f"{kind.__module__}.{kind.__qualname__}"


def _snake(name: str) -> str:
    return re.sub(r"(?<=[a-z0-9])(?=[A-Z])|(?<=[A-Z])(?=[A-Z][a-z])", "_", name).lower()
