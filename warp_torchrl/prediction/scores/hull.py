"""Concave hull of hot spots: the area that published validations take for burned."""

from typing import Any

import numpy as np
import torch
from torch import Tensor


def hull_cells(hot: Tensor, ratio: float) -> Tensor:
    """Return the cells whose middles lie in the concave hull of some cells' middles, holes left out, bool [H, W].

    Args:
        hot: Cells in which a hot spot lies, bool [H, W].
        ratio: Longest edge of the hull between the shortest (0) and the longest (1) of the points' triangulation.

    Raises:
        ValueError: If the package shapely is not installed.
    """
    shapely = _shapely()
    rows, columns = (each.double().numpy() for each in hot.nonzero(as_tuple=True))
    hull = shapely.concave_hull(shapely.MultiPoint(np.stack((columns, rows), 1)), ratio=ratio, allow_holes=True)
    shapely.prepare(hull)
    height, width = hot.shape
    down, across = np.mgrid[:height, :width]
    return torch.from_numpy(shapely.intersects_xy(hull, across.ravel(), down.ravel()).reshape(height, width)) | hot


def _shapely() -> Any:
    try:
        import shapely
    except ImportError:
        raise ValueError('hull needs shapely, which is missing: pip install "warp_torchrl[scores]"') from None
    return shapely
