"""What all heuristics share: how they are called, and what they see and do."""

import math
from typing import ClassVar

import torch
from tensordict import TensorDictBase
from tensordict.nn import TensorDictModuleBase
from torch import Tensor

from warp_torchrl.env import WildfireEnv
from warp_torchrl.world.fast.distances import FAR, nearest
from warp_torchrl.world.geometry import DIRECTIONS
from warp_torchrl.world.random import Stream, uniform_at
from warp_torchrl.world.state import Action, Cover, WorldState, is_burning
from warp_torchrl.world.team import Team


class Heuristic(TensorDictModuleBase):
    """A baseline for the teams of one environment.

    Args:
        env: The environment whose worlds it acts in.
    """

    in_keys = [("agents", "action_mask")]  # noqa: RUF012
    out_keys = [("agents", "action")]  # noqa: RUF012
    remembers: ClassVar[bool] = False
    """Whether what it does depends on more than the state."""

    def __init__(self, env: WildfireEnv) -> None:
        super().__init__()
        self._env = (env,)  # in a tuple, so that the environment does not become a submodule

    @property
    def env(self) -> WildfireEnv:
        """Return the environment it acts in."""
        return self._env[0]

    def forward(self, tensordict: TensorDictBase) -> TensorDictBase:
        """Write the team's actions, int64 [B, A]."""
        action = self.choose(self.env.world_state, tensordict.get(("agents", "action_mask")))
        return tensordict.set(("agents", "action"), action)

    def choose(self, state: WorldState, mask: Tensor) -> Tensor:
        """Return the actions, int64 [B, A], for worlds and action masks [B, A, actions]."""
        raise TypeError(f"{type(self).__name__} does not say what to do: define choose()")


def idle_action(mask: Tensor, team: Team) -> Tensor:
    """Return the action that does nothing, int64 [...], of action masks [..., actions]: stay, or a masked one."""
    if team.allow_stay:
        return torch.full(mask.shape[:-1], int(Action.STAY), device=mask.device)
    return mask.to(torch.uint8).argmin(dim=-1)


def can_be_put_out(state: WorldState, env: WildfireEnv) -> Tensor:
    """Return the burning cells that an agent could put out, bool [B, H, W]."""
    return is_burning(state.cells) & (state.cells <= env.world.fire.last_spreading)


def list_cells(mask: Tensor) -> tuple[Tensor, Tensor]:
    """Return the marked cells of each world in row-major order, so that work can grow with them, not with the map.

    Args:
        mask: bool [B, H, W].

    Returns:
        Flat indices, int64 [B, K], K the most that any world has (1 where none has any), and which of them are cells
        and not padding, bool [B, K].
    """
    marked = mask.flatten(1)
    counts = marked.sum(dim=1)
    world, cell = marked.nonzero().unbind(dim=1)
    index = marked.new_zeros(len(marked), max(int(counts.max()), 1), dtype=torch.int64)
    index[world, torch.arange(len(world), device=mask.device) - (counts.cumsum(0) - counts)[world]] = cell
    return index, torch.arange(index.shape[1], device=mask.device) < counts[:, None]


def way_to(state: WorldState, cells: Tensor) -> Tensor:
    """Return the Chebyshev distance from each agent to cells [B, K], float32 [B, A, K]."""
    gap = state.vehicles.position[:, :, None] - place(cells, state)[:, None]
    return gap.abs().amax(dim=-1).to(torch.float32)


def nearest_fire(state: WorldState, fire: Tensor) -> tuple[Tensor, Tensor]:
    """Return each agent's distance to the nearest fire, float32 [B, A], ``FAR`` where none burns, and its flat index.

    Equally near ones are told apart by a draw of each agent's own: agents that stand together and see the same would
    otherwise do the same for ever.
    """
    cells, valid = list_cells(fire)
    agents = torch.arange(state.vehicles.position.shape[1], device=cells.device)[:, None]
    draw = (agents * fire[0].numel() + cells[:, None]).to(torch.int32)
    taste = uniform_at(state.key, 0, Stream.POLICY, draw.flatten(1)).view(draw.shape)
    best = (way_to(state, cells) + taste).masked_fill_(~valid[:, None], float(FAR)).min(dim=-1)
    return best.values.floor(), cells.gather(1, best.indices)


def place(index: Tensor, state: WorldState) -> Tensor:
    """Return (row, column) of a flat index, int64 [..., 2]."""
    width = state.cells.shape[2]
    return torch.stack((index // width, index % width), dim=-1)


def approach(state: WorldState, env: WildfireEnv, target: Tensor) -> Tensor:
    """Return the move that brings each agent nearest to its target, int64 [B, A].

    Turning straight back costs as much as a cell of way, so that agents slide along a lake instead of swinging.
    """
    vehicles, team = state.vehicles, env.world.team
    offsets = torch.tensor(DIRECTIONS, device=target.device)
    reached = vehicles.position[:, :, None] + offsets * team.table(target.device).stride[:, None, None]
    gap = (reached - target[:, :, None]).abs().to(torch.float32)
    way = gap.amax(-1) + 0.01 * gap.sum(-1)
    direction = torch.arange(8, device=target.device)
    last = vehicles.last_action[..., None]
    way = way + ((direction == (last + 4) % 8) & (last >= 0) & (last < 8))
    return way.masked_fill(~team.open_moves(state), float(FAR)).argmin(dim=-1)


def or_refill(state: WorldState, env: WildfireEnv, target: Tensor) -> Tensor:
    """Return the targets of agents with water, and the nearest lake or the base for those whose tank is empty."""
    if not env.world.team.tank:
        return target
    water = state.landscape.cover == Cover.LAKE
    base = state.vehicles.base[:, 0] * water.shape[2] + state.vehicles.base[:, 1]
    water = water.flatten(1).scatter(1, base[:, None], True).view_as(water)
    _, index = nearest(state.vehicles.position, water)
    return torch.where((state.vehicles.tank == 0)[..., None], place(index, state), target)


def claim_cells(
    state: WorldState, cells: Tensor, value: Tensor, elbow_room: int, discount: float, taken: float
) -> Tensor:
    """Return a cell for each agent, int64 [B, A, 2], the best of value less way, one agent after the other.

    In each of as many rounds as there are agents, the best pair of an agent without a claim and a cell is taken, and
    the cells about it are discounted for the others. An agent whom no cell is worth anything stays where it is.

    Args:
        state: The worlds.
        cells: Flat indices of the cells to share out, int64 [B, K].
        value: What each is worth to each agent [cells of way], -inf for nothing, float32 [B, 1 or A, K].
        elbow_room: Cells about a claim that the others avoid.
        discount: What avoiding them is worth [cells of way].
        taken: What avoiding the claimed cell itself is worth.
    """
    gain = value - way_to(state, cells)
    worlds, agents, count = gain.shape
    place_of = place(cells, state)
    claim = state.vehicles.position.clone()
    rows = torch.arange(worlds, device=cells.device)
    for _ in range(agents):
        best = gain.flatten(1).max(dim=1)
        agent, cell = best.indices // count, best.indices % count
        claimed = place_of[rows, cell]
        worth = torch.isfinite(best.values)[:, None]
        claim[rows, agent] = torch.where(worth, claimed, claim[rows, agent])
        distance = (place_of - claimed[:, None]).abs().amax(dim=-1)
        gain -= (discount * (distance <= elbow_room) + taken * (distance == 0))[:, None]
        gain[rows, agent] = -math.inf
    return claim


def extinguish_or(move: Tensor, mask: Tensor) -> Tensor:
    """Return extinguish where it is open, else the move."""
    return torch.where(mask[..., Action.EXTINGUISH], int(Action.EXTINGUISH), move)
