"""Beliefs as pictures: what a team takes the map to be, where it thinks that fire burns, and what it has not seen."""

from typing import Literal, get_args

import torch
from torch import Tensor

from warp_torchrl.env.pictures.render import ground_colours
from warp_torchrl.world.mechanics.mechanic import Mechanic
from warp_torchrl.world.state.cells import is_burning
from warp_torchrl.world.state.records import KNOWLEDGE, freshness, kept
from warp_torchrl.world.state.state import WorldState
from warp_torchrl.world.world import World

View = Literal["truth", "belief", "both"]
VIEWS: tuple[View, ...] = get_args(View)
"""What a picture shows: the fire; what the team believes of it; the fire under a veil of what is believed."""
BELIEVED = ((104, 30, 140), (216, 48, 124), (255, 126, 64), (255, 226, 92))
"""Of a fire that is thought to burn, from unlikely to sure: no colour of trees, and none of water."""
HIDDEN, FOG = (150, 150, 255), (50, 55, 66)
_COVERS = 0.92  # how much a sure fire covers
_OVER_FIRE = 0.3  # how much of the veil lies over a cell that burns
_FAINT = 0.55  # most of what a hidden fire covers
_HALF = 0.02  # chance of a hidden fire that covers half of that
_FOGS = 4  # shades, so that pictures of an animation differ in few cells
_THICK = 0.85  # how much fog covers of what was never seen


def veil_colours() -> dict[str, tuple[int, int, int]]:
    """Return a colour of each item of the veil, by its name."""
    likely = {"thought to burn": BELIEVED[-1], "may burn": BELIEVED[1]}
    return {**likely, "may hide a fire": HIDDEN, "not seen lately": FOG}


def first_view(world: World) -> View:
    """Return what is shown of a world unless someone chooses: the veil too where its team has beliefs."""
    return "both" if isinstance(world.belief, Mechanic) else "truth"


def checked_view(name: str) -> View:
    """Return the view of a name.

    Raises:
        ValueError: If it is none of ``VIEWS``.
    """
    for view in VIEWS:
        if view == name:
            return view
    raise ValueError(f"view must be one of {', '.join(VIEWS)}, got {name}")


def can_believe(world: World) -> bool:
    """Return whether what a team takes the fire to be may differ from the fire."""
    return world.sensing.is_limited


def seen_as(state: WorldState, world: World, view: View) -> tuple[WorldState, Tensor]:
    """Return the worlds as a view shows them, and the colour of each cell, uint8 [B, H, W, 3].

    Where agents have maps of their own, each cell is that of the agent which saw it last, and chances are their mean.
    """
    if view == "truth" or not can_believe(world):
        return state, ground_colours(state)
    known, hidden = (each.mean(dim=1) for each in world.believed_fire(state))
    if view == "both":
        colours = ground_colours(state).to(torch.float32)
        share = torch.where(is_burning(state.cells), _OVER_FIRE, _COVERS)
        return state, _veiled(colours, known, hidden, share)
    shown = _assumed(state, world)
    colours = ground_colours(shown.without_planes(KNOWLEDGE)).to(torch.float32)
    newest = kept(state).amax(dim=1, keepdim=True)
    unknown = _THICK * ((1.0 - freshness(newest, state.step)[:, 0]) * _FOGS).round() / _FOGS
    return shown, _veiled(_mixed(colours, _colour(FOG, colours), unknown), known, hidden, known.new_tensor(_COVERS))


def _assumed(state: WorldState, world: World) -> WorldState:
    """Return the worlds as the team takes them to be: where agents have maps of their own, as the last to look does."""
    assumed = world.assumed(state)
    views = len(assumed.key) // len(state.key)
    if views == 1:
        return state.replace(
            cells=assumed.cells, age=assumed.age, burned=assumed.burned, firebreak=assumed.firebreak, wet=assumed.wet
        )
    last = kept(state).argmax(dim=1, keepdim=True)
    own = {
        name: getattr(assumed, name).unflatten(0, (-1, views)).gather(1, last)[:, 0]
        for name in ("cells", "age", "burned", "firebreak", "wet")
    }
    return state.replace(**own)


def _veiled(colours: Tensor, known: Tensor, hidden: Tensor, share: Tensor) -> Tensor:
    """Return colours [B, H, W, 3] under the veil of fires that may burn, uint8."""
    faint = _FAINT * hidden / (hidden + _HALF)
    colours = _mixed(colours, _colour(HIDDEN, colours), faint)
    stops = torch.tensor(BELIEVED, dtype=torch.float32, device=colours.device)
    at = known.clamp(0.0, 1.0) * (len(stops) - 1)
    low = at.long().clamp(max=len(stops) - 2)
    veil = stops[low].lerp(stops[low + 1], (at - low)[..., None])
    return _mixed(colours, veil, share * known.clamp(0.0, 1.0).sqrt()).round().to(torch.uint8)


def _mixed(colours: Tensor, others: Tensor, share: Tensor) -> Tensor:
    return colours.lerp(others, share[..., None])


def _colour(rgb: tuple[int, int, int], like: Tensor) -> Tensor:
    return torch.tensor(rgb, dtype=torch.float32, device=like.device).expand_as(like)
