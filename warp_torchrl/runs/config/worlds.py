"""Worlds of a training, built: the kinds of its mixture, and the levels of its curriculum."""

from collections.abc import Mapping, Sequence
from copy import deepcopy
from dataclasses import dataclass, fields
from typing import Any

import torch
from torch import Tensor

from warp_torchrl.collection.curriculum import Curriculum
from warp_torchrl.env import WildfireEnv
from warp_torchrl.env.observation import Observation
from warp_torchrl.env.reward import Reward
from warp_torchrl.env.specs import make_specs
from warp_torchrl.models import differing, signature
from warp_torchrl.runs.config.components import build_mechanics
from warp_torchrl.runs.config.construction import ConfigError, build, construct
from warp_torchrl.validation import did_you_mean, dotted
from warp_torchrl.world.arrays.batch import Batch
from warp_torchrl.world.world import World


@dataclass(frozen=True, kw_only=True)
class KindOfWorld:
    """A kind of worlds, built.

    Attributes:
        name: Name of the kind.
        world: Its rules.
        share: Share of the worlds, in proportion to the shares of the others.
        teacher: Teacher of its worlds; None for none.
        teacher_weight: Factor on the weight of the cloning loss.
    """

    name: str
    world: World
    share: float = 1.0
    teacher: str | None = None
    teacher_weight: float = 1.0


def check_kinds(kinds: Sequence[KindOfWorld], observation: Observation, reward: Reward) -> None:
    """Check that one team can play all kinds of a mixture, and the reward can be computed in each.

    Raises:
        ConfigError: If observations, states, actions, roles or agencies differ: the first kind and entry that do.
    """
    first = None
    for kind in kinds:
        try:
            env = WildfireEnv(kind.world, observation=observation, reward=reward, device=torch.device("cpu"))
        except ValueError as error:
            raise ConfigError(f"mixture.kinds.{kind.name}: {error}") from None
        here = signature(env)
        first = first or here
        other = differing(first, here)
        if other is not None:
            raise ConfigError(
                f"mixture.kinds.{kind.name}: one team must see and do the same in all kinds, and its {other} differs "
                f"from that of {kinds[0].name}"
            )


def level_worlds(config: Mapping[str, Any], built: Mapping[str, Any], keys: tuple[str, ...]) -> list[World]:
    """Return the world of each level of a configuration's curriculum, easy to hard.

    Args:
        config: Composed, as plain values.
        built: Its components, the curriculum among them; levels share those that are the same.
        keys: What a scenario sets.

    Raises:
        ConfigError: If the curriculum names what is no key of a scenario, a list does not end with the scenario's own
            value, or a value breaks a rule.
    """
    levels = []
    for number, values in enumerate(_configs(config, built["curriculum"], keys)):
        groups = [name for name in keys if isinstance(values[name], Mapping) and values[name] != config[name]]
        try:
            own = {name: _built(name, values[name]) for name in groups}
            parts = {**values, **built, **own}
            fitting = {each.name: parts[each.name] for each in fields(World)}
            levels.append(construct(World, fitting, ""))
        except ConfigError as error:
            raise ConfigError(f"curriculum.over, level {number}: {error}") from None
    return levels


def _built(name: str, node: Any) -> Any:
    """Return what a key of a scenario describes."""
    return build_mechanics(node) if name == "mechanics" else build(node, name)


def _configs(config: Mapping[str, Any], curriculum: Curriculum, keys: tuple[str, ...]) -> list[dict[str, Any]]:
    """Return the configuration of each level."""
    lists = curriculum.values()
    if not lists:
        raise ConfigError("curriculum.over must name a key of the scenario: curriculum.over.steps_per_tick=[20,10,5]")
    scenario = dotted({name: config[name] for name in keys})
    known = {key: value for key, value in scenario.items() if not key.endswith("_target_")}
    for key, values in lists.items():
        if key not in known:
            raise ConfigError(f"curriculum.over.{key} is not a key of the scenario{did_you_mean(key, list(known))}")
        own = known[key]
        if values[-1] != own or isinstance(values[-1], bool) != isinstance(own, bool):
            raise ConfigError(f"curriculum.over.{key} must end with the scenario's own value, {own}, got {values[-1]}")
    return [
        _with(config, {key: values[level] for key, values in lists.items()}) for level in range(curriculum.n_levels)
    ]


def _with(config: Mapping[str, Any], values: Mapping[str, Any]) -> dict[str, Any]:
    made: dict[str, Any] = deepcopy(dict(config))
    for key, value in values.items():
        *groups, name = key.split(".")
        node = made
        for group in groups:
            node = node[group]
        node[name] = value
    return made


def check_alike(levels: list[World], curriculum: Curriculum, observation: Observation) -> None:
    """Check that worlds of all levels can stand in one batch, and one team can play them.

    Raises:
        ConfigError: If their teams, observations or states have other shapes: the first one, and the level's values.
    """
    shapes = [_shapes(world, observation) for world in levels]
    for level, its in enumerate(shapes):
        other = sorted(name for name in {*its, *shapes[-1]} if its.get(name) != shapes[-1].get(name))
        if other:
            keys = ", ".join(f"{key}={values[level]}" for key, values in curriculum.values().items())
            raise ConfigError(
                f"curriculum.over: worlds of every level must have the shapes of the scenario's, and {other[0]} is "
                f"{its.get(other[0], 'not there')} with {keys} and {shapes[-1].get(other[0], 'not there')} without"
            )


def _shapes(world: World, observation: Observation) -> dict[str, str]:
    """Return what must be alike, as texts by name."""
    specs = make_specs(world, observation, 1, torch.device("cpu"))
    entries = [*specs.observation.items(True, True), *specs.action.items(True, True)]
    found = {_name(key): f"{list(spec.shape[1:])}" for key, spec in entries}
    zero = torch.zeros(1, dtype=torch.int64)
    team = {"team.roles": list(world.team.agent_roles), "team.actions": list(world.team.action_names)}
    return found | {name: str(value) for name, value in team.items()} | _leaves(world.start(zero, zero)[0])


def _name(key: Any) -> str:
    return key if isinstance(key, str) else ".".join(key)


def _leaves(batch: Batch, prefix: str = "state.") -> dict[str, str]:
    """Return the shapes and types of a batch's tensors, and its numbers, by name; what is None has no name."""
    found: dict[str, str] = {}
    for name, value in batch.parts():
        if isinstance(value, Batch):
            found |= _leaves(value, f"{prefix}{name}.")
        elif value is not None:
            found[prefix + name] = (
                f"{str(value.dtype)[6:]} {list(value.shape[1:])}" if isinstance(value, Tensor) else str(value)
            )
    return found
