"""Simulated futures: copies of worlds that continue with other draws."""

from dataclasses import replace

from torch import Tensor

from warp_torchrl.world.state.state import WorldState
from warp_torchrl.world.team.knowledge import Belief, Full
from warp_torchrl.world.world import World


def rules_in_sight(world: World) -> World:
    """Return the rules of a world with full sight, and without a radio and what else is about knowledge alone."""
    kept = tuple(each for each in world.mechanics if not each.is_knowledge)
    if not world.sensing.is_limited and len(kept) == len(world.mechanics):
        return world
    return replace(world, sensing=Full(), belief=Belief(), mechanics=kept)


def imagined(state: WorldState, key: Tensor, world: World) -> WorldState:
    """Return worlds whose future draws have another key, int64 [B], under ``rules_in_sight``.

    What was drawn at the start of the episode stays: the ground, the prevailing wind, the hour of the weather.
    """
    knowledge = [each.name for each in world.loop if each.is_knowledge]
    return state.without_planes(*knowledge).replace(key=key, origin=state.episode_key)
