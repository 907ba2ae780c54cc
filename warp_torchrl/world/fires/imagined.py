"""Simulated futures: copies of worlds that continue with other draws, and the rules in which they do."""

from dataclasses import replace

from torch import Tensor

from warp_torchrl.world.ensemble import members
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
    """Return worlds whose future draws have another key, int64 [B], under ``rules_in_sight``."""
    return members.imagined(state, [each.name for each in world.loop if each.is_knowledge], key)
