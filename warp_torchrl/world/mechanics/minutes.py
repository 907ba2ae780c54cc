"""Minutes of a tick and of a step, for mechanics that count them."""

from warp_torchrl.world.mechanics.mechanic import Rules

USUAL = 10.0
"""Minutes of a tick under laws without minutes where nothing else is said: a cell of 30 m at 3 m/min."""


def minutes_of_tick(world: Rules, given: float | None) -> float:
    """Return the minutes of a fire tick: those of the law, else the given ones, else ``USUAL``."""
    if world.fire.minutes is not None:
        return world.fire.minutes
    return USUAL if given is None else given


def check_minutes(world: Rules, name: str, given: float | None) -> None:
    """Check that minutes of a tick are given where they are read.

    Args:
        world: The rules.
        name: Of the mechanic, whose key is ``minutes_per_tick``.
        given: Its value.

    Raises:
        ValueError: If the law has minutes already.
    """
    if given is not None and world.fire.minutes is not None:
        raise ValueError(
            f"mechanics.{name}.minutes_per_tick is read under laws without minutes; this one has "
            f"fire.minutes_per_tick, got {given:g}"
        )
