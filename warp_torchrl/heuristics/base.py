"""Functions that the heuristics share."""

import math

import torch
from torch import Tensor

from warp_torchrl.world.arrays.distances import FAR, nearest
from warp_torchrl.world.arrays.geometry import offsets
from warp_torchrl.world.arrays.listing import list_cells
from warp_torchrl.world.arrays.random import Stream, uniform, uniform_at
from warp_torchrl.world.state.cells import is_burning
from warp_torchrl.world.state.records import known_codes, records_of
from warp_torchrl.world.state.state import FIRST_FIRE, Action, Cover, WorldState
from warp_torchrl.world.team.presence import on_scene
from warp_torchrl.world.team.supply import mark_base
from warp_torchrl.world.team.team import Team
from warp_torchrl.world.world import World


def idle_action(mask: Tensor, team: Team) -> Tensor:
    """Return an action without effect, int64 [...]: stay, or else one that the mask [..., actions] forbids.

    Where it forbids none it is a move, which leaves fire and forest alone.
    """
    if team.allow_stay:
        return torch.full(mask.shape[:-1], int(Action.STAY), device=mask.device)
    return mask.to(torch.uint8).argmin(dim=-1)


def can_be_put_out(state: WorldState, world: World) -> Tensor:
    """Return the burning cells that an agent can extinguish, bool [B, H, W].

    Those at which mechanics let nobody work (``Mechanic.workable``) are left out in worlds that have others.
    """
    fire = is_burning(state.cells) & (state.cells <= world.fire.last_spreading)
    for each in world.loop:
        able = each.workable(state, world)
        if able is not None:
            fire = torch.where((fire & able).flatten(1).any(dim=1)[:, None, None], fire & able, fire)
    return fire


def steps_to_clear(state: WorldState, world: World) -> Tensor | None:
    """Return how many steps one agent takes to clear each cell, float32 [B, H, W]; None where it takes one."""
    told = (each.steps_to_clear(state, world) for each in reversed(world.loop))
    return next((each for each in told if each is not None), None)


def steps_to_put_out(state: WorldState, world: World, cells: Tensor) -> Tensor | None:
    """Return the steps that each agent alone takes to put out fires, see ``Mechanic.steps_to_put_out``."""
    told = (each.steps_to_put_out(state, cells) for each in reversed(world.loop))
    return next((each for each in told if each is not None), None)


def steps_here(state: WorldState, world: World) -> tuple[Tensor, Tensor] | None:
    """Return the steps of each agent's acts where it is, see ``Mechanic.steps_here``."""
    told = (each.steps_here(state) for each in reversed(world.loop))
    return next((each for each in told if each is not None), None)


def agent_distance(state: WorldState, cells: Tensor) -> Tensor:
    """Return the Chebyshev distance from each agent to cells [B, K], float32 [B, A, K]."""
    return moves_between(state.vehicles.position, *rows_and_columns(cells, state))


def moves_between(places: Tensor, rows: Tensor, columns: Tensor) -> Tensor:
    """Return the Chebyshev distance from places, int64 [B, A, 2], to cells, float32 [B, K] each, float32 [B, A, K]."""
    row, column = places.to(torch.float32)[:, :, None].unbind(dim=-1)
    return torch.maximum((rows[:, None] - row).abs_(), (columns[:, None] - column).abs_())


def rows_and_columns(cells: Tensor, state: WorldState) -> tuple[Tensor, Tensor]:
    """Return the rows and the columns of flat indices, float32, each contiguous, which is fast to read."""
    width = state.cells.shape[2]
    return (cells // width).to(torch.float32), (cells % width).to(torch.float32)


def nearest_fire(state: WorldState, fire: Tensor) -> tuple[Tensor, Tensor]:
    """Return each agent's distance to the nearest fire, float32 [B, A], ``FAR`` where none burns, and its flat index.

    Each agent breaks ties by a random draw: agents in one cell would otherwise act alike forever.
    """
    cells, valid = list_cells(fire)
    agents = torch.arange(state.vehicles.position.shape[1], device=cells.device)[:, None]
    draw = (agents * fire[0].numel() + cells[:, None]).to(torch.int32)
    tie_break = uniform_at(state.key, 0, Stream.POLICY, draw.flatten(1)).view(draw.shape)
    best = (agent_distance(state, cells) + tie_break).masked_fill_(~valid[:, None], float(FAR)).min(dim=-1)
    return best.values.floor(), cells.gather(1, best.indices)


def known_fire(state: WorldState, world: World) -> Tensor:
    """Return the burning cells that each agent knows of and could extinguish, bool [B, A, H, W]."""
    if records_of(state) is None:
        return can_be_put_out(state, world)[:, None].expand(-1, state.vehicles.position.shape[1], -1, -1)
    codes = known_codes(state)
    return (codes >= FIRST_FIRE) & (codes <= world.fire.last_spreading)


def distance_to_cells(state: WorldState) -> Tensor:
    """Return the Chebyshev distance from each agent to each cell, float32 [B, A, H, W]."""
    return distance_from(state.vehicles.position, state)


def distance_from(place: Tensor, state: WorldState) -> Tensor:
    """Return the Chebyshev distance from places, (row, column) int64 [..., 2], to each cell, float32 [..., H, W].

    Least and largest of float32 are found many times sooner than of int64.
    """
    row, column = (torch.arange(side, dtype=torch.float32, device=place.device) for side in state.cells.shape[1:])
    own = place.to(torch.float32)[..., None]
    return torch.maximum((row - own[..., 0, :]).abs()[..., :, None], (column - own[..., 1, :]).abs()[..., None, :])


def nearest_marked(state: WorldState, marked: Tensor) -> tuple[Tensor, Tensor]:
    """Return whether each agent has a marked cell, bool [B, A], and the flat index of the one nearest to it.

    Ties are broken as in ``nearest_fire``.

    Args:
        state: The worlds.
        marked: Cells of each agent's own, bool [B, A, H, W].
    """
    distance = distance_to_cells(state) + uniform(state.key, 0, Stream.POLICY, tuple(marked.shape[1:]))
    best = distance.masked_fill_(~marked, float(FAR)).flatten(2).min(dim=-1)
    return best.values < FAR, best.indices


def place(index: Tensor, state: WorldState) -> Tensor:
    """Return (row, column) of a flat index, int64 [..., 2]."""
    width = state.cells.shape[2]
    return torch.stack((index // width, index % width), dim=-1)


def move_towards(state: WorldState, world: World, target: Tensor) -> Tensor:
    """Return the move that brings each agent closest to its target, int64 [B, A].

    Reversing costs one cell of distance, so that agents follow a lake's shore instead of oscillating.
    """
    vehicles, team = state.vehicles, world.team
    reached = vehicles.position[:, :, None] + offsets(target.device) * team.table(target.device).stride[:, None, None]
    gap = (reached - target[:, :, None]).abs().to(torch.float32)
    way = gap.amax(-1) + 0.01 * gap.sum(-1)
    direction = torch.arange(8, device=target.device)
    last = vehicles.last_action[..., None]
    way = way + ((direction == (last + 4) % 8) & (last >= 0) & (last < 8))
    return way.masked_fill(~world.open_moves(state), float(FAR)).argmin(dim=-1)


def target_or_base(state: WorldState, world: World, target: Tensor) -> Tensor:
    """Return the given targets, or the base for agents that must set out for it, see ``Mechanic.due_at_base``.

    int64 [B, A, 2].
    """
    roles, base = world.team.table(target.device), state.vehicles.base[:, None]
    for each in world.loop:
        due = each.due_at_base(state, roles)
        target = target if due is None else torch.where(due[..., None], base, target)
    return target


def target_or_supply(state: WorldState, world: World, target: Tensor) -> Tensor:
    """Return the given targets, or the nearest lake or the base for agents that run out of water or charge.

    int64 [B, A, 2].
    """
    target = target_or_base(state, world, target)
    if not world.team.tank:
        return target
    water = mark_base(state, state.landscape.cover == Cover.LAKE)
    _, index = nearest(state.vehicles.position, water)
    supply = base_or_water(state, world, place(index, state))
    return torch.where((state.vehicles.tank == 0)[..., None], supply, target)


def base_or_water(state: WorldState, world: World, water: Tensor) -> Tensor:
    """Return the places of water, int64 [B, A, 2], but the base for agents whose tanks fill there alone."""
    for each in world.loop:
        at_base = each.fills_at_base(state)
        water = water if at_base is None else torch.where(at_base[..., None], state.vehicles.base[:, None], water)
    return water


def claim_cells(state: WorldState, cells: Tensor, value: Tensor, spacing: int, discount: float, taken: float) -> Tensor:
    """Assign a cell to each agent by greedy matching of value minus distance, int64 [B, A, 2].

    Each round assigns the best pair of a cell and an agent without one, then lowers the value of the cells near it for
    the other agents. An agent for which every cell has value -inf keeps its position.

    Args:
        state: The worlds.
        cells: Flat indices of the candidate cells, int64 [B, K].
        value: Value of each cell for each agent [cells of distance], float32 [B, 1 or A, K]; -inf excludes a cell.
        spacing: Chebyshev distance within which an assigned cell lowers the value of others [cells].
        discount: Amount by which it lowers them [cells of distance].
        taken: Further amount for the assigned cell itself [cells of distance].
    """
    return match_cells(state, cells, value - agent_distance(state, cells), spacing, discount, taken)


def match_cells(state: WorldState, cells: Tensor, gain: Tensor, spacing: int, discount: float, taken: float) -> Tensor:
    """Return the assignment of ``claim_cells``, int64 [B, A, 2], from each agent's gain by each cell.

    Args:
        state: The worlds.
        cells: Flat indices of the candidate cells, int64 [B, K].
        gain: Value less distance [cells of distance], float32 [B, A, K]; -inf excludes a cell. It is overwritten.
        spacing: See ``claim_cells``.
        discount: See ``claim_cells``.
        taken: See ``claim_cells``.
    """
    worlds, agents, count = gain.shape
    there = on_scene(state)
    gain = gain if there is None else gain.masked_fill_(~there[..., None], -math.inf)
    claim = state.vehicles.position.clone()
    rows, columns = rows_and_columns(cells, state)
    world = torch.arange(worlds, device=cells.device)
    for _ in range(agents):
        best = gain.flatten(1).max(dim=1)
        agent, which = best.indices // count, best.indices % count
        worth = torch.isfinite(best.values)[:, None]
        claim[world, agent] = torch.where(worth, place(cells[world, which], state), claim[world, agent])
        row, column = rows[world, which][:, None], columns[world, which][:, None]
        distance = torch.maximum((rows - row).abs_(), (columns - column).abs_())
        gain -= (discount * (distance <= spacing) + taken * (distance == 0))[:, None]
        gain[world, agent] = -math.inf
    return claim


def extinguish_or(move: Tensor, mask: Tensor) -> Tensor:
    """Return extinguish where the mask allows it, else the move."""
    return torch.where(mask[..., Action.EXTINGUISH], int(Action.EXTINGUISH), move)
