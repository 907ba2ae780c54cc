"""Where fire can go from where it burns."""

import torch
from torch import Tensor

from warp_torchrl.world.arrays.detours import moves_from
from warp_torchrl.world.state.state import WorldState, is_tree
from warp_torchrl.world.world import World


def way_of_fire(state: WorldState, world: World) -> Tensor:
    """Return the cells that fire has to go to each tree that it can reach, int32 [B, H, W], else 0.

    Fire goes over trees that can burn, around firebreaks, lakes and young trees, to its eight neighbours. Ways are
    followed for as many cells as the map's longer side has.
    """
    youngest = 1 if world.fire.growth else world.fire.youngest_fuel
    fuel = is_tree(state.cells) & (state.cells >= youngest) & (state.alpha > 0.0)
    worlds, height, width = fuel.shape
    cells = torch.arange(height * width, device=fuel.device).expand(worlds, -1)
    moves = moves_from(world.fire.spreads(state), fuel, cells).view_as(fuel)
    return moves * (fuel & (moves <= max(height, width)))
