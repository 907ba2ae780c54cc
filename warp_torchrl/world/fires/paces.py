"""Factors on the times of fires: those drawn by their laws, those of members, and fronts that are half-way."""

from collections.abc import Sequence

import torch
from torch import Tensor

from warp_torchrl.world.law.rate import RateFire
from warp_torchrl.world.state.window import Window


def drawn_paces(laws: Sequence[RateFire], key: Tensor, window: Window) -> Tensor:
    """Return the factors that laws draw for cells and fires, 1 over those on their rates, float32 [b, h, w].

    Args:
        laws: Each of as many fires, one after the other.
        key: Of the fires, int64 [b].
        window: Of the map.
    """
    keys = key.chunk(len(laws))
    paces = [
        law.pace(each, window.map) if window.is_whole else law.pace_in(each, window)
        for law, each in zip(laws, keys, strict=True)
    ]
    return paces[0] if len(paces) == 1 else torch.cat(paces)


def rates_in(rate: Tensor, sector: Tensor | None, window: Window) -> Tensor:
    """Return the factors on the rates of fires in a window, float32 [b, h, w] or [b, 1, 1].

    Args:
        rate: Of each fire, float32 [b], or in each sector, float32 [b, S].
        sector: The sector of each cell, int64 [H, W]; None: one factor everywhere.
        window: Of the map.
    """
    if sector is None:
        return rate[:, None, None]
    place = window.cut(sector, 0)
    return rate.index_select(1, place.flatten()).view(len(rate), *place.shape)
