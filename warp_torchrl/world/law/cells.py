"""Cell codes as a law reads them, in plain comparisons; ``state.cells`` reads the same faster."""

from torch import Tensor

from warp_torchrl.world.state.state import EMPTY, FIRST_FIRE, OLDEST, Cover


def is_burning(cells: Tensor) -> Tensor:
    """Return which cells burn, bool, shape of the codes."""
    return cells >= FIRST_FIRE


def is_tree(cells: Tensor) -> Tensor:
    """Return which cells hold a tree that does not burn, bool, shape of the codes."""
    return (cells > EMPTY) & (cells <= OLDEST)


def holds_trees(cover: Tensor) -> Tensor:
    """Return where a tree can stand (wetland, grassland, forest), bool, shape of the codes."""
    return (cover != int(Cover.LAKE)) & (cover != int(Cover.BARE))
