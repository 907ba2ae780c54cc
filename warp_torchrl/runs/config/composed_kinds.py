"""The worlds of a mixture's kinds: scenarios of ``conf/scenario`` with overrides."""

import json
from collections.abc import Mapping
from typing import Any

from warp_torchrl.collection.imitation import check_teacher
from warp_torchrl.collection.mixture import Kind, Mixture
from warp_torchrl.runs.config.components import build_components
from warp_torchrl.runs.config.compose import OPTION, compose_config, plain
from warp_torchrl.runs.config.construction import ConfigError, construct
from warp_torchrl.runs.config.groups import OF_WORLDS, WORLD_KEYS
from warp_torchrl.runs.config.kinds import KindOfWorld
from warp_torchrl.validation import dotted
from warp_torchrl.world.world import World


def kinds_of_worlds(config: Mapping[str, Any], mixture: Mixture, teacher: str | None) -> list[KindOfWorld]:
    """Return the kinds of a mixture, built.

    Args:
        config: Composed, as plain values: what the radio carries is the run's in every kind.
        mixture: Names them.
        teacher: Of kinds that name none.

    Raises:
        ConfigError: If there are fewer than two, or a kind has an unknown key or scenario, a key that is none of the
            worlds, or a value that breaks a rule.
    """
    if len(mixture.kinds) < 2:
        told = ", ".join(mixture.kinds) or "none: 'mixture.kinds={default:{},water:{share:2}}' names two"
        raise ConfigError(f"mixture.kinds must be two or more, got {told}")
    found = []
    for name, node in mixture.kinds.items():
        where = f"mixture.kinds.{name}"
        kind = construct(Kind, {"scenario": name, **(node or {})}, where)
        taught_by = kind.teacher or teacher
        if taught_by is not None:
            try:
                check_teacher(taught_by)
            except ValueError as error:
                raise ConfigError(f"{where}.{error}") from None
        try:
            world = _world(config, kind)
        except ConfigError as error:
            raise ConfigError(f"{where}: {error}") from None
        weight = kind.teacher_weight
        found.append(KindOfWorld(name=name, world=world, share=kind.share, teacher=taught_by, teacher_weight=weight))
    return found


def _written(value: Any) -> str:
    """Return a value in the grammar of the command line."""
    return value if isinstance(value, str) and OPTION.fullmatch(value) else json.dumps(value)


def _world(config: Mapping[str, Any], kind: Kind) -> World:
    for key in kind.over:
        if key not in WORLD_KEYS or key == "scenario":
            raise ConfigError(f"over must name keys of the worlds, {', '.join(WORLD_KEYS[1:])}, got {key}")
    overrides = [f"{key}={_written(value)}" for key, value in dotted(kind.over).items()]
    values = plain(compose_config("train", [f"scenario={kind.scenario}", *overrides]))
    if "radio" in config["mechanics"]:
        values["mechanics"].setdefault("radio", {})["carries"] = config["mechanics"]["radio"].get("carries", "none")
    world: World = build_components(values, OF_WORLDS)["world"]
    return world
