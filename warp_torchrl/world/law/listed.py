"""Some cells of landscapes as maps of their own, and how steeply the ground rises there."""

import torch
from torch import Tensor
from torch.nn.functional import pad

from warp_torchrl.world.arrays.batch import Named
from warp_torchrl.world.state.state import Landscape


def gradient(elevation: Tensor | None, cover: Tensor, cell_size: float) -> Tensor:
    """Return how steeply the ground rises to the east and to the north, float32 [B, 2, H, W]; 0 where it is level.

    By Horn's differences over the eight neighbours (Horn 1981), the border's cells repeated beyond it.
    """
    if elevation is None:
        return torch.zeros(len(cover), 2, *cover.shape[1:], device=cover.device)
    ground = pad(elevation[:, None], (1, 1, 1, 1), mode="replicate")[:, 0]
    across = ground[:, :, 2:] - ground[:, :, :-2]
    along = ground[:, :-2] - ground[:, 2:]
    east = (across[:, :-2] + 2.0 * across[:, 1:-1] + across[:, 2:]) / (8.0 * cell_size)
    north = (along[:, :, :-2] + 2.0 * along[:, :, 1:-1] + along[:, :, 2:]) / (8.0 * cell_size)
    return torch.stack((east, north), dim=1)


def gradient_at(elevation: Tensor | None, cover: Tensor, cell_size: float, cell: Tensor) -> Tensor:
    """Return what ``gradient`` does in ``listed`` cells, float32 [B, 2, n]."""
    if elevation is None:
        return torch.zeros(len(cell), 2, cell.shape[1], device=cover.device)
    (height, width), flat = elevation.shape[1:], elevation.reshape(len(cell), -1)
    place = cell % (height * width)
    row, column = place.div(width, rounding_mode="floor"), place % width
    rows = [cell - place + (row + down).clamp(0, height - 1) * width for down in (-1, 0, 1)]
    columns = [(column + right).clamp(0, width - 1) for right in (-1, 0, 1)]

    def across(line: Tensor) -> Tensor:
        return flat.gather(1, line + columns[2]) - flat.gather(1, line + columns[0])

    def along(place: Tensor) -> Tensor:
        return flat.gather(1, rows[0] + place) - flat.gather(1, rows[2] + place)

    east, north = (
        (of[0] + 2.0 * of[1] + of[2]) / (8.0 * cell_size) for of in (list(map(across, rows)), list(map(along, columns)))
    )
    return torch.stack((east, north), dim=1)


def listed(landscape: Landscape, cell: Tensor) -> Landscape:
    """Return some cells of landscapes as maps of one row; what rises is read of the whole ones.

    Args:
        landscape: The landscapes, batch size [B].
        cell: Flat indices in each map, int64 [B, n], or in all of them, int64 [1, n].
    """
    planes = {"cover": landscape.cover, "age": landscape.age, **landscape.layers.held}
    own = {name: plane.reshape(len(cell), -1).gather(1, cell)[:, None] for name, plane in planes.items()}
    return Landscape(own.pop("cover"), own.pop("age"), None, layers=Named(own))
