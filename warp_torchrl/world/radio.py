"""The team's radio: who hears whom."""

import torch
from torch import Tensor

from warp_torchrl.world.random import Stream, uniform
from warp_torchrl.world.state import WorldState
from warp_torchrl.world.team import Team

MAST = 3.0
"""Height of a ground vehicle's antenna over the ground [m]."""
ALTITUDE = 100.0
"""Height at which aircraft fly over the ground [m]."""
_SAMPLES = 16
"""Points of a line of sight at which it is compared with the ground."""


def heard(state: WorldState, team: Team) -> Tensor:
    """Return which agents hear which, bool [B, A, A]: [b, i, j] where agent i hears agent j; none hears itself.

    Agents hear those within ``team.radio_range`` (Euclidean distance), along a line of sight over the terrain if
    ``team.radio_line_of_sight``, but for the packets that are lost: each with chance ``team.radio_loss``, drawn for
    each pair and step.
    """
    agents = state.vehicles.position.shape[1]
    others = ~torch.eye(agents, dtype=torch.bool, device=state.cells.device)
    links = others.expand(len(state.cells), -1, -1)
    if team.radio_range is not None:
        apart = (state.vehicles.position[:, :, None] - state.vehicles.position[:, None]).to(torch.float32)
        near = apart.square().sum(-1) <= team.radio_range**2
        links = links & near if team.radio_range > 0.0 else torch.zeros_like(near)
    if team.radio_line_of_sight and state.landscape.elevation is not None:
        links = links & _in_line_of_sight(state, state.landscape.elevation, team)
    if team.radio_loss > 0.0:
        links = links & (uniform(state.key, state.step, Stream.RADIO, (agents, agents)) >= team.radio_loss)
    return links


def radio(state: WorldState, team: Team) -> Tensor:
    """Return what agents know of those whom they hear, float32 [B, A, A, 3].

    Of each agent and each other: 1 where it hears it, else 0; and rows and columns from it to the other [cells], 0
    where it does not hear it.
    """
    hears = heard(state, team)[..., None].to(torch.float32)
    position = state.vehicles.position
    return torch.cat((hears, hears * (position[:, None] - position[:, :, None])), dim=-1)


def _in_line_of_sight(state: WorldState, elevation: Tensor, team: Team) -> Tensor:
    """Return between which agents no ground stands in the way, bool [B, A, A]."""
    position, width = state.vehicles.position, elevation.shape[2]
    ground = elevation.flatten(1)
    flies = team.table(position.device).flies
    own = ground.gather(1, position[..., 0] * width + position[..., 1]) + torch.where(flies, ALTITUDE, MAST)
    share = (torch.arange(_SAMPLES, device=position.device) + 0.5) / _SAMPLES
    here, there = position[:, :, None, None].to(torch.float32), position[:, None, :, None].to(torch.float32)
    along = (here + (there - here) * share[:, None]).round().to(torch.int64)  # [B, A, A, S, 2]
    between = ground.gather(1, (along[..., 0] * width + along[..., 1]).flatten(1)).view(along.shape[:-1])
    line = own[:, :, None, None] + (own[:, None, :, None] - own[:, :, None, None]) * share
    return (between <= line).all(dim=-1)
