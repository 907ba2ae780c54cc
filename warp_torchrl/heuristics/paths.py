"""Ways of agents round what they cannot enter."""

import math

import torch
from torch import Tensor

from warp_torchrl.heuristics.base import agent_distance, idle_action
from warp_torchrl.world.arrays.detours import moves_around
from warp_torchrl.world.arrays.distances import FAR
from warp_torchrl.world.state.cells import is_burning
from warp_torchrl.world.state.state import Cover, WorldState
from warp_torchrl.world.team.abilities import own_cell, places
from warp_torchrl.world.world import World


def is_open(state: WorldState) -> Tensor:
    """Return the cells that ground vehicles can enter now, bool [B, H, W]: no lakes, and no fire."""
    return ~((state.cover == int(Cover.LAKE)) | is_burning(state.cells))


def open_to_agents(state: WorldState, world: World) -> Tensor:
    """Return the cells that each agent can enter now, bool [B, A, H, W]: no lakes or fire, unless it flies."""
    return is_open(state)[:, None] | world.team.table(state.cells.device).flies[:, None, None]


def path_length(state: WorldState, world: World, cells: Tensor) -> Tensor:
    """Return each agent's path length to cells [B, K], float32 [B, A, K] [cells]; ``FAR`` or more without a path.

    Aircraft, whose moves are longer, have no advantage by it: they would claim what others are at already.
    """
    moves = moves_around(own_cell(state), open_to_agents(state, world), cells[:, None])
    return torch.where(moves == FAR, FAR + agent_distance(state, cells), moves)


def first_move(state: WorldState, world: World, mask: Tensor, target: Tensor) -> Tensor:
    """Return the first move of a shortest path to each agent's target, int64 [B, A]; at the target, wait.

    Of ways that are as short, the one whose first move leads nearest to the target, by rows and columns together.

    Args:
        state: The worlds.
        world: Their rules.
        mask: The actions that do something, bool [B, A, actions].
        target: (row, column) of each agent's, int64 [B, A, 2].
    """
    team = world.team
    step = team.table(mask.device).moves
    reached, _ = places(state, step)
    goal = target[..., 0] * state.cells.shape[2] + target[..., 1]
    gap = (state.vehicles.position[:, :, None] + step.mT - target[:, :, None]).abs().to(torch.float32)
    can = world.open_moves(state)
    around = torch.where(can, reached, goal[..., None])  # open moves alone
    moves = moves_around(goal, open_to_agents(state, world), around)
    way = torch.where(moves == FAR, FAR + gap.amax(dim=-1), moves) + 0.01 * gap.sum(dim=-1)
    move = way.masked_fill_(~can, math.inf).argmin(dim=-1)
    waits = (goal == own_cell(state)) & ~is_burning(state.cells.flatten(1).gather(1, goal))
    return torch.where(waits | ~can.any(dim=-1), idle_action(mask, team), move)
