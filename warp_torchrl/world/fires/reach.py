"""Distance from the fire along cells that can burn."""

import torch
from torch import Tensor

from warp_torchrl.world.arrays.detours import moves_from
from warp_torchrl.world.state.cells import is_tree
from warp_torchrl.world.state.state import WorldState
from warp_torchrl.world.world import World


def distance_from_fire(state: WorldState, world: World) -> Tensor:
    """Return the number of cells from the fire to each tree that it can reach, int32 [B, H, W], else 0.

    Fire spreads over trees that can burn, around firebreaks, lakes and young trees, to its eight neighbours. Distances
    above the map's longer side count as out of reach.
    """
    youngest = 1 if world.fire.growth else world.fire.youngest_fuel
    fuel = is_tree(state.cells) & (state.cells >= youngest) & (state.alpha > 0.0)
    worlds, height, width = fuel.shape
    cells = torch.arange(height * width, device=fuel.device).expand(worlds, -1)
    moves = moves_from(world.fire.spreads(state), fuel, cells).view_as(fuel)
    return moves * (fuel & (moves <= max(height, width)))
