"""The canopy of landscapes: how it shelters fuel, and whether fires can run in it."""

from dataclasses import fields

import torch
from torch import Tensor

from warp_torchrl.world.behaviour.crown import LEAST_COVER, Canopy
from warp_torchrl.world.behaviour.wind_adjustment import TEN_METRES, wind_adjustment_factor
from warp_torchrl.world.state.state import Landscape

_UNTOLD_HEIGHT = 15.0  # m, of a canopy of which no height is known


def to_midflame(depth: Tensor, landscape: Landscape) -> Tensor:
    """Return the midflame wind over that at 10 m: under the canopy where one is known, else over the fuel bed.

    Args:
        depth: Of the fuel bed, float32 [B, H, W] [ft].
        landscape: The landscapes.
    """
    none = torch.zeros_like(depth)
    cover, height = landscape.layer("canopy_cover"), landscape.layer("canopy_height")
    cover, height = none if cover is None else cover, none + _UNTOLD_HEIGHT if height is None else height
    return wind_adjustment_factor(depth, cover, height, none + 1.0) / TEN_METRES


def crowns_of(landscape: Landscape) -> Canopy | None:
    """Return the crowns of landscapes; None unless cover, height, base height and bulk density are all known."""
    layers = {each.name: landscape.layer(f"canopy_{each.name}") for each in fields(Canopy)}
    known = {name: layer for name, layer in layers.items() if layer is not None}
    return Canopy(**known) if len(known) == len(layers) else None


def lack_of_canopy(landscape: Landscape) -> str | None:
    """Return in a line what Rothermel's rates lack without layers of a canopy; None where nothing is missing."""
    cover = landscape.layer("canopy_cover")
    if cover is None:
        return "no canopy cover is read: the wind is that over open ground everywhere, and no fire runs in crowns"
    if crowns_of(landscape) is not None or not bool((cover > LEAST_COVER).any()):
        return None
    return "no canopy base height and bulk density are read: no fire runs in crowns"
