"""Losses of assets by flame length, and rates of vehicles: the tables of ``values``."""

import torch
from torch import Tensor

from warp_torchrl.world.arrays.bytes import above, below
from warp_torchrl.world.arrays.constants import numbers
from warp_torchrl.world.arrays.shortlist import marked_cells

LEVELS = (0.6096, 1.2192, 1.8288, 2.4384, 3.6576)
"""Flame lengths that part the six fire intensity levels, 2, 4, 6, 8 and 12 ft [m] (Scott, Thompson and Calkin 2013)."""
HOMES = (0.25, 0.40, 0.55, 0.70, 0.85, 1.0)
"""Share of a home's worth that is lost at each level. They are ours, after the form of the response functions of
Wildfire Risk to Communities (Scott and others 2020): a quarter at the least flames, 0.15 more a level, all at the
most."""
RATES = {"ugv": 250.0, "uav": 2000.0, "scout": 500.0, "tanker": 7000.0}
"""US dollars an hour by role: a bulldozer of type 2 with its operator and transport, a helicopter of type 3, a light
aircraft that leads others, a large airtanker. They are round numbers of the size of the rates that agencies publish
each year (California, hired equipment, handbook 3934; USDA Forest Service, aviation annual reports)."""


def lost(flames: Tensor, losses: tuple[float, ...]) -> Tensor:
    """Return the share of an asset's worth that is lost to flames of some length; 0 without any.

    A response function by fire intensity level: the net value change of Scott, Thompson and Calkin (2013), "A wildfire
    risk assessment framework for land and resource management", USDA Forest Service RMRS-GTR-315.

    Args:
        flames: Flame lengths, float32 [m].
        losses: Of the six levels, 0..1.
    """
    level = torch.bucketize(flames, numbers(LEVELS, flames.device), right=True)
    return numbers(losses, flames.device)[level] * (flames > 0.0)


def kept(flames: Tensor, spared: Tensor, losses: tuple[float, ...]) -> Tensor:
    """Return the share of its worth that flames and embers leave of each asset, float32.

    Args:
        flames: The longest that it was exposed to, float32 [m].
        spared: Chance that no ember has ignited it, float32.
        losses: See ``lost``.
    """
    return (1.0 - lost(flames, losses)) * spared


def share_left(worth: Tensor, flames: Tensor, spared: Tensor, losses: tuple[float, ...]) -> Tensor:
    """Return the share of each world's worth that flames and embers leave, float32 [B]; 1 where there was none.

        sum(worth kept) / sum(worth)

    Few cells have met any, and ``kept`` is dear: it is made of these alone.

    Args:
        worth: Of each cell before the fire, float32 [B, H, W].
        flames: See ``kept``, [B, H, W].
        spared: See ``kept``, [B, H, W].
        losses: See ``lost``.
    """
    cell = marked_cells(above(worth, 0.0) & (above(flames, 0.0) | below(spared, 1.0)))
    own, flames, spared = (plane.flatten().index_select(0, cell) for plane in (worth, flames, spared))
    after = worth.flatten().index_copy(0, cell, own * kept(flames, spared, losses)).view(worth.shape)
    total, left = (each.flatten(1).sum(dim=1) for each in (worth, after))
    return torch.where(total > 0.0, left / total.clamp(min=1e-30), 1.0)


def longest_about(flames: Tensor, cells: int) -> Tensor:
    """Return the longest flames within a Chebyshev distance of each cell, float32 [B, H, W].

    Args:
        flames: Flame lengths, float32 [B, H, W] [m].
        cells: The distance.
    """
    for _ in range(cells):  # on CPUs several times faster than pooling
        rows = flames.clone()
        torch.maximum(rows[:, 1:], flames[:, :-1], out=rows[:, 1:])
        torch.maximum(rows[:, :-1], flames[:, 1:], out=rows[:, :-1])
        flames = rows.clone()
        torch.maximum(flames[..., 1:], rows[..., :-1], out=flames[..., 1:])
        torch.maximum(flames[..., :-1], rows[..., 1:], out=flames[..., :-1])
    return flames
