"""In which block of the map something is."""

from torch import Tensor

from warp_torchrl.world.state.state import WorldState


def block_of(state: WorldState, side: int) -> Tensor:
    """Return in which of side x side blocks of the map each agent is, int64 [B, A]."""
    return block_at(state.vehicles.position, state, side)


def block_at(place: Tensor, state: WorldState, side: int) -> Tensor:
    """Return in which of side x side blocks of the map cells are, int64 [...], of (row, column) int64 [..., 2]."""
    height, width = state.cells.shape[1:]
    row, column = place.unbind(-1)
    return (row * side // height) * side + column * side // width
