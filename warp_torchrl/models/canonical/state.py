"""The central critic's state, turned towards the fire and moved so that the fire is in its middle."""

import torch
from torch import Tensor

from warp_torchrl.entries import TeamPlanes
from warp_torchrl.models.canonical.entries import pull_from
from warp_torchrl.models.canonical.orientation import Orientation, cells, orientation_to

_NEAR = 0.5
"""Distance that is added to that of a target [cells of the state]."""


def canonical_state(state: Tensor, symmetry: TeamPlanes) -> Tensor:
    """Return states [..., C, S, S] as the middle of the team sees them, turned towards the targets.

    The box that holds all targets and agents is in the middle of the planes, so that where it is on the map makes no
    difference; off the map there is nothing.
    """
    side = state.shape[-1]
    team = state[..., symmetry.agents[0] : sum(symmetry.agents), :, :].sum(-3)
    target = state[..., symmetry.target, :, :]
    along = torch.arange(side, device=state.device) + 0.5
    place = torch.stack([(each * along).sum(-1) for each in (team.sum(-1), team.sum(-2))], dim=-1)
    orientation = orientation_to(pull_from(place / team.sum((-2, -1))[..., None], target, _NEAR))
    happening = (target > 0) | (team > 0)
    shown = _moved(state, orientation, _corner(orientation.planes(happening[..., None, :, :])[..., 0, :, :]))
    quarters = state[..., -1, :, :].unflatten(-1, (2, side // 2)).unflatten(-3, (2, side // 2))
    scalars, vector = quarters[..., 0, 0, :, 0], quarters[..., 1, 0, :, 0]
    constants = torch.stack((scalars, orientation.vectors(vector)), dim=-2)[..., :, None, :, None]
    shown[..., -1, :, :] = constants.expand_as(quarters).reshape(state[..., -1, :, :].shape)
    return shown


def _corner(marked: Tensor) -> Tensor:
    """Return the row and column, int64 [..., 2], of the map's corner that puts the box of marked cells in the middle.

    Args:
        marked: bool [..., S, S].
    """
    side = marked.shape[-1]
    along = torch.arange(side, device=marked.device)
    found = []
    for lines in (marked.any(-1), marked.any(-2)):
        first = torch.where(lines, along, side).amin(-1)
        last = torch.where(lines, along, -1).amax(-1)
        found.append((first + last + 1) // 2 - side // 2)
    return torch.stack(found, dim=-1)


def _moved(planes: Tensor, orientation: Orientation, start: Tensor) -> Tensor:
    """Return planes [..., C, S, S] in an orientation from the row and column ``start`` on, int64 [..., 2].

    Off the map there is 0.
    """
    side = planes.shape[-1]
    lines = start[..., None] + torch.arange(side, device=planes.device)
    row, column = lines.clamp(0, side - 1).unbind(-2)
    turned = (row[..., :, None] * side + column[..., None, :]).flatten(-2)
    cell = cells(side, planes.device)[orientation.index].gather(-1, turned)
    shown = planes.flatten(-2).gather(-1, cell.unsqueeze(-2).expand(*planes.shape[:-2], -1)).view(planes.shape)
    down, across = ((lines >= 0) & (lines < side)).unbind(-2)
    return shown.mul_((down[..., :, None] & across[..., None, :]).unsqueeze(-3))
