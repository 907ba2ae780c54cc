"""Canonical inputs: each agent's entries are turned so that its target lies between its east and its south-east.

Whatever is learnt of one case then holds for all eight (canonical inputs, as in Kaba et al., "Equivariance with learned
canonicalization functions", 2023, with a rule instead of the learnt function). The orientation follows from the agent's
observation, so that a policy stays decentralised.
"""

import math
from collections.abc import Mapping

import torch
from torch import Tensor

from warp_torchrl.entries import Part, Planes, Target, Vector
from warp_torchrl.models.canonical.orientation import Orientation, orientation_to
from warp_torchrl.system.modes import kept

Symmetries = Mapping[str, Planes | Vector]
"""What each entry of an observation declares, by name."""
_UNITS = 2.0**16
"""Pulls are whole numbers of such parts: sums are exact in any order, so that a tie is a tie in any batch."""


def turned(entry: Tensor, symmetry: Planes | Vector, orientation: Orientation) -> Tensor:
    """Return an entry, batch dimensions first, in an orientation."""
    if isinstance(symmetry, Planes):
        planes = orientation.planes(_planes(entry, symmetry))
        return planes.flatten(-3) if symmetry.is_flat else planes
    parts = entry.split([len(part.names) for part in symmetry.parts], dim=-1)
    return torch.cat([_turned_part(*each, orientation) for each in zip(parts, symmetry.parts, strict=True)], dim=-1)


def orientation_of(entries: Mapping[str, Tensor], symmetries: Symmetries) -> Orientation:
    """Return the orientation in which the targets that each agent sees lie between its east and its south-east.

    They lie where the sum of the offsets to them points, each over (its Chebyshev distance + near)^3.

    Args:
        entries: Of the observation by name, batch dimensions first.
        symmetries: At least one of them has a target.

    Returns:
        Orientations [...] of the batch dimensions.
    """
    *first, (name, target, planes) = targets(symmetries)
    pull = _pull(entries, symmetries, target, _planes(entries[name], planes))
    for name, target, planes in reversed(first):
        shown = _planes(entries[name], planes)
        is_seen = (shown[..., target.channel, :, :] > 0).flatten(-2).any(-1)
        pull = torch.where(is_seen[..., None], _pull(entries, symmetries, target, shown), pull)
    return orientation_to(pull)


def targets(symmetries: Symmetries) -> list[tuple[str, Target, Planes]]:
    """Return the targets with the names of their entries, in their order."""
    found = [
        (name, each.target, each)
        for name, each in symmetries.items()
        if isinstance(each, Planes) and each.target is not None
    ]
    return sorted(found, key=lambda each: each[1].order)


def place_of(symmetries: Symmetries) -> tuple[str, slice] | None:
    """Return the entry, and the slice in it, with an agent's place on the map; None without one."""
    found = ((name, each.place()) for name, each in symmetries.items() if isinstance(each, Vector))
    return next(((name, place) for name, place in found if place is not None), None)


def pull_from(place: Tensor, weight: Tensor, near: float) -> Tensor:
    """Return the direction in which weights of cells [..., S, S] pull from places [cells] [..., 2], int64 [..., 2]."""
    side = weight.shape[-1]
    along = torch.arange(side, device=weight.device) + 0.5
    down, across = along - place[..., :1], along - place[..., 1:]
    distance = torch.maximum(down.abs()[..., :, None], across.abs()[..., None, :]) + near
    weight = weight * _UNITS / (distance * distance * distance)
    pulls = weight * down[..., :, None], weight * across[..., None, :]
    return torch.stack([each.round().to(torch.int64).sum((-2, -1)) for each in pulls], dim=-1)


def _pull(entries: Mapping[str, Tensor], symmetries: Symmetries, target: Target, planes: Tensor) -> Tensor:
    """Return the direction in which targets in planes [..., C, S, S] pull each agent, int64 [..., 2]."""
    plane = planes[..., target.channel, :, :]
    weight = plane if target.is_share else plane > 0
    place = None if target.in_middle else place_of(symmetries)
    if place is None:
        return (weight.flatten(-2).to(torch.float64) @ _offsets(plane.shape[-1], target.near, plane.device)).long()
    return pull_from(entries[place[0]][..., place[1]] * plane.shape[-1], weight, target.near)


def _turned_part(part: Tensor, declared: Part, orientation: Orientation) -> Tensor:
    if declared.kind == "place":
        return orientation.offsets(part - 0.5) + 0.5
    if declared.kind == "vector":
        return orientation.vectors(part)
    return orientation.by_action(part, declared.names) if declared.kind == "actions" else part


def _planes(entry: Tensor, symmetry: Planes) -> Tensor:
    """Return the planes [..., C, S, S] of an entry."""
    if not symmetry.is_flat:
        return entry
    side = math.isqrt(entry.shape[-1] // symmetry.channels)
    return entry.unflatten(-1, (symmetry.channels, side, side))


@kept(16)
def _offsets(side: int, near: float, device: torch.device) -> Tensor:
    """Return the pull of a target at each cell about the middle, whole numbers, float64 [S S, 2]."""
    along = torch.arange(side, dtype=torch.float64) - side // 2
    away = torch.cartesian_prod(along, along)
    return (away * _UNITS / (away.abs().amax(-1, keepdim=True) + near) ** 3).round().to(device)
