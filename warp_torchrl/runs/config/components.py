"""Components of a composed configuration, and the world that they make."""

from collections.abc import Mapping, Sequence
from typing import Any

from warp_torchrl.env.metrics import chosen_goal
from warp_torchrl.runs.config.construction import COMPONENTS, ConfigError, build, chosen, construct
from warp_torchrl.validation import did_you_mean
from warp_torchrl.world.mechanics.mechanic import Mechanic
from warp_torchrl.world.mechanics.table import mechanics
from warp_torchrl.world.world import World


def build_components(config: Mapping[str, Any], names: Sequence[str] = COMPONENTS) -> dict[str, Any]:
    """Build components of a composed configuration, and the ``world`` of those that make one.

    Args:
        config: As plain values.
        names: Which; those of the world must be among them.

    Raises:
        ConfigError: With key, value and rule.
    """
    first = ("model",) if "model" in names else ()  # whose messages are the team's: mistakes are told of the model
    built = {name: build(config[name], name) for name in dict.fromkeys((*first, *names))}
    built["mechanics"] = build_mechanics(config.get("mechanics", {}))
    world = construct(World, chosen(World, {**config, **built}), "")
    try:
        chosen_goal(world)
        if "reward" in built:
            built["reward"].check_world(world)
    except ValueError as error:
        raise ConfigError(str(error)) from None
    return {**built, "world": world}


def build_mechanics(values: object) -> tuple[Mechanic, ...]:
    """Build the mechanics of a world from their values by name; a mechanic without values has its defaults.

    Raises:
        ConfigError: With key, value and rule.
    """
    if not isinstance(values, Mapping):
        raise ConfigError(f"mechanics must be a mapping, got {values!r}")
    known = mechanics()
    for name in values:
        if name not in known:
            hint = did_you_mean(name, known)
            raise ConfigError(f"mechanics must be some of {', '.join(known)}, got {name}{hint}")
    return tuple(construct(known[name], own or {}, f"mechanics.{name}") for name, own in values.items())
