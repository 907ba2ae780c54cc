"""Cell and cover codes in words, at the speed of byte arithmetic."""

from torch import Tensor

from warp_torchrl.world.arrays.bytes import at_least, between, byte, counts, equal
from warp_torchrl.world.state.state import FIRST_FIRE, OLDEST, Cover, TreeCounts, WorldState


def is_burning(cells: Tensor) -> Tensor:
    """Return which cells, uint8 codes, burn (11..15), bool, shape of the input."""
    return at_least(cells, FIRST_FIRE)


def is_tree(cells: Tensor) -> Tensor:
    """Return which cells, uint8 codes, hold a tree that does not burn (1..10), bool, shape of the input."""
    return between(cells, 1, OLDEST)


def holds_trees(cover: Tensor) -> Tensor:
    """Return where a tree can stand (wetland, grassland, forest), bool, shape of the input."""
    return ~(equal(cover, int(Cover.LAKE)) | equal(cover, int(Cover.BARE)))


def count_trees(state: WorldState) -> TreeCounts:
    """Count the initial trees by fate.

        T_p + T_e + T_c + T_b + burning = N0      (WARP-CA, conservation metric)

    A tree that has once burned to ash stays counted as burned when the ground regrows.
    """
    initial, burned, burning = byte(state.initial), byte(state.burned), byte(is_burning(state.cells))
    unburned = initial & (burned ^ 1)
    alive = unburned & byte(is_tree(state.cells))
    trees, standing, extinguished, cleared, ash, aflame, alight = counts(
        initial,
        alive,
        alive & byte(state.extinguished),
        unburned & byte(state.firebreak),
        initial & burned,
        unburned & burning,
        burning,
    )
    return TreeCounts(
        initial=trees,
        preserved=standing - extinguished,
        extinguished=extinguished,
        cleared=cleared,
        burned=ash,
        burning=aflame,
        alight=alight,
    )
