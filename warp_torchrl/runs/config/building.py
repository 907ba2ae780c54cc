"""Building a run's configuration: every component, and every kind of worlds, made and checked from plain values."""

import json
from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from dataclasses import fields
from functools import partial
from typing import Any

from warp_torchrl.collection.imitation import Imitation, check_teacher
from warp_torchrl.collection.mixture import Kind, Mixture
from warp_torchrl.runs.config.components import build_components
from warp_torchrl.runs.config.compose import OPTION, compose_config, option_names
from warp_torchrl.runs.config.construction import (
    COMMAND_KEYS,
    COMPONENTS,
    OF_WORLDS,
    WORLD_KEYS,
    ConfigError,
    chosen,
    construct,
)
from warp_torchrl.runs.config.options import CheckpointConfig, EvaluationConfig
from warp_torchrl.runs.config.plain_values import plain
from warp_torchrl.runs.config.run_config import RunConfig
from warp_torchrl.runs.config.worlds import KindOfWorld, level_worlds
from warp_torchrl.validation import did_you_mean, dotted
from warp_torchrl.world.world import World


def run_config(config: Mapping[str, Any]) -> RunConfig:
    """Check a composed configuration and build what it describes.

    Raises:
        ConfigError: With key, value and rule.
    """
    check_keys(config)
    for key in COMPONENTS:
        if key not in config:
            raise ConfigError(f"{key} must be given")
    built = build_components(config)
    parts = {"checkpoint": CheckpointConfig, "evaluation": EvaluationConfig, "imitation": Imitation}
    built |= {name: construct(kind, config.get(name, {}), name) for name, kind in parts.items()}
    built["make_levels"] = partial(level_worlds, config, built, WORLD_KEYS)
    built["make_kinds"] = partial(kinds_of_worlds, config, teacher=built["imitation"].teacher)
    values = chosen(RunConfig, {**config, **built})
    _check_together(config)
    made = construct(RunConfig, values, "")
    with _in_section("algorithm"):
        made.algorithm.check_batch(made.n_worlds * made.collector.steps)
    with _in_section("model"):
        made.algorithm.check_model(made.model)
    with _in_section("collector"):
        made.collector.check_worlds(made.n_worlds)
    with _in_section("imitation"):
        made.imitation.check_fits(made.algorithm, made.collector, made.model)
    return made


class BuildOnce:
    """``run_config`` that keeps what it built last: a command checks a run, and then runs what it has checked."""

    def __init__(self) -> None:
        self._values: Mapping[str, Any] | None = None
        self._built: RunConfig | None = None

    def __call__(self, config: Mapping[str, Any]) -> RunConfig:
        """Return what ``run_config`` does; see there for arguments and errors."""
        if self._built is None or config != self._values:
            self._built, self._values = run_config(config), config
        return self._built


def check_keys(config: Mapping[str, Any]) -> None:
    """Check that a composed configuration has known keys only, as Hydra's ``+key`` adds any, and a known scenario.

    Raises:
        ConfigError: With the first unknown key, or the scenario, and the known ones.
    """
    known = {each.name for each in fields(RunConfig)} | {*COMPONENTS, *WORLD_KEYS, *COMMAND_KEYS}
    for key in config:
        if key not in known:
            has = f"it has {', '.join(sorted(known - {'world', 'make_levels', 'make_kinds'}))}"
            raise ConfigError(f"{key} is not a key of the configuration; {has}{did_you_mean(key, known)}")
    if not isinstance(config.get("debug", False), bool):
        raise ConfigError(f"debug must be true or false, got {config['debug']!r}")
    scenarios = option_names("scenario")
    if config["scenario"] not in scenarios:
        raise ConfigError(
            f"scenario must be one of {', '.join(scenarios)}, got {config['scenario']}; runs in another could not be "
            "read again: put it into a plug-in, and list that, plugins=[...]"
        )


@contextmanager
def _in_section(section: str) -> Iterator[None]:
    """Add the section of the configuration to errors in this context."""
    try:
        yield
    except ValueError as error:
        raise ConfigError(f"{section}.{error}") from None


def _check_together(config: Mapping[str, Any]) -> None:
    reward, algorithm = config["reward"], config["algorithm"]
    model, radio = config["model"]["messages"], config["mechanics"].get("radio") or {}
    carries, delay, rounds = radio.get("carries", "none"), radio.get("delay", 0), config["model"]["message_rounds"]
    if model in ("graph", "both") and carries not in ("graph", "both"):
        raise ConfigError(
            f"mechanics.radio.carries must be graph or both where networks talk, model.messages={model}, got {carries}"
        )
    if model in ("graph", "both") and delay and rounds != 1:
        raise ConfigError(
            f"model.message_rounds must be 1 where messages come late, mechanics.radio.delay={delay}, got {rounds}"
        )
    trust, observation = config["model"].get("trust", 0.0), config["observation"]
    if trust and not (observation.get("advice") and observation.get("rules")):
        raise ConfigError(
            "model.trust must be 0 where agents are not advised and told the rules, observation.advice and "
            f"observation.rules, got {trust}"
        )
    mixer, cooperation = algorithm.get("mixer", "none"), reward.get("cooperation", 1.0)
    if mixer != "none" and cooperation != 1.0:
        raise ConfigError(
            f"reward.cooperation must be 1 where the team has one value, algorithm.mixer={mixer}, got {cooperation}"
        )
    if reward["shaping"] > 0.0 and reward["gamma"] != algorithm["gamma"]:
        raise ConfigError(
            f"reward.gamma must be algorithm.gamma, {algorithm['gamma']}, for shaping to leave optimal policies as "
            f"they are, got {reward['gamma']}"
        )


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
        if key.partition(".")[0] not in WORLD_KEYS or key == "scenario":
            raise ConfigError(f"over must name keys of the worlds, {', '.join(WORLD_KEYS[1:])}, got {key}")
    overrides = [f"{key}={_written(value)}" for key, value in dotted(kind.over).items()]
    values = plain(compose_config("train", [f"scenario={kind.scenario}", *overrides]))
    if "radio" in config["mechanics"]:
        values["mechanics"].setdefault("radio", {})["carries"] = config["mechanics"]["radio"].get("carries", "none")
    world: World = build_components(values, OF_WORLDS)["world"]
    return world
