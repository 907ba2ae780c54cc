"""Simulated futures: copies of worlds that continue with other draws."""

from dataclasses import replace

from torch import Tensor

from warp_torchrl.world.state.records import KNOWLEDGE
from warp_torchrl.world.state.state import WorldState
from warp_torchrl.world.team.hearing import HEARING, Hearing
from warp_torchrl.world.team.knowledge import Full
from warp_torchrl.world.world import World


def rules_in_sight(world: World) -> World:
    """Return the rules of a world with full sight, and without a radio."""
    if not world.sensing.is_limited and not world.hearing.is_late:
        return world
    others = tuple(each for each in world.mechanics if not isinstance(each, Hearing))
    return replace(world, sensing=Full(), mechanics=others)


def imagined(state: WorldState, key: Tensor) -> WorldState:
    """Return worlds whose future draws have another key, int64 [B], under ``rules_in_sight``.

    What was drawn at the start of the episode stays: the ground, the prevailing wind, the hour of the weather.
    """
    return state.without_planes(KNOWLEDGE, HEARING).replace(key=key, origin=state.episode_key)
