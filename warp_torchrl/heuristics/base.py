"""What all heuristics share: how they are called, and what they see and do."""

import torch
from tensordict import TensorDictBase
from tensordict.nn import TensorDictModuleBase
from torch import Tensor

from warp_torchrl.env import WildfireEnv
from warp_torchrl.world.geometry import DIRECTIONS, FAR, chebyshev_distance, nearest
from warp_torchrl.world.random import Stream, uniform
from warp_torchrl.world.state import Action, Cover, WorldState, is_burning


class Heuristic(TensorDictModuleBase):
    """A rule of thumb for the teams of one environment.

    Args:
        env: The environment whose worlds it acts in.
    """

    in_keys = [("agents", "action_mask")]  # noqa: RUF012
    out_keys = [("agents", "action")]  # noqa: RUF012

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
        """Return the actions, int64 [B, A], for worlds and action masks [B, A, 10 or 11]."""
        raise TypeError(f"{type(self).__name__} does not say what to do: define choose()")


def idle_action(mask: Tensor) -> Tensor:
    """Return the action that does nothing, int64 [...], of action masks [..., 10 or 11]: stay, or a masked one."""
    if mask.shape[-1] > Action.STAY:
        return torch.full(mask.shape[:-1], int(Action.STAY), device=mask.device)
    return mask.to(torch.uint8).argmin(dim=-1)


def can_be_put_out(state: WorldState, env: WildfireEnv) -> Tensor:
    """Return the burning cells that an agent could put out, bool [B, H, W]."""
    return is_burning(state.cells) & (state.cells <= env.world.fire.last_spreading)


def nearest_fire(state: WorldState, fire: Tensor) -> tuple[Tensor, Tensor]:
    """Return each agent's distance to the nearest fire, float32 [B, A], and its flat index, int64 [B, A].

    Equally near ones are told apart by a draw of each agent's own: agents that stand together and see the same would
    otherwise do the same for ever.
    """
    distance = chebyshev_distance(state.vehicles.position, fire).flatten(2)
    taste = uniform(state.key, 0, Stream.POLICY, tuple(distance.shape[1:]))
    best = (distance + taste).min(dim=-1)
    return best.values.floor(), best.indices


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


def claim_cells(state: WorldState, value: Tensor, elbow_room: int, discount: float, taken: float) -> Tensor:
    """Return a cell for each agent, int64 [B, A, 2], the best of value less way, one agent after the other.

    In each of as many rounds as there are agents, the best pair of an agent without a claim and a cell is taken, and
    the cells about it are discounted for the others.

    Args:
        state: The worlds.
        value: What each cell is worth to each agent [cells of way], float32 [B, H, W] or [B, A, H, W].
        elbow_room: Cells about a claim that the others avoid.
        discount: What avoiding them is worth [cells of way].
        taken: What avoiding the claimed cell itself is worth.
    """
    position = state.vehicles.position
    worlds, agents = position.shape[:2]
    everywhere = torch.ones_like(state.cells, dtype=torch.bool)
    gain = (value if value.ndim == 4 else value[:, None]) - chebyshev_distance(position, everywhere)
    claim = torch.zeros(worlds, agents, dtype=torch.int64, device=value.device)
    for _ in range(agents):
        best = gain.flatten(1).argmax(dim=1)
        agent, cell = best // everywhere[0].numel(), best % everywhere[0].numel()
        claim.scatter_(1, agent[:, None], cell[:, None])
        distance = chebyshev_distance(place(cell[:, None], state), everywhere)
        gain = gain - discount * (distance <= elbow_room) - taken * (distance == 0)
        gain.scatter_(1, agent[:, None, None, None].expand(-1, 1, *everywhere.shape[1:]), -3.0 * FAR)
    return place(claim, state)


def extinguish_or(move: Tensor, mask: Tensor) -> Tensor:
    """Return extinguish where it is open, else the move."""
    return torch.where(mask[..., Action.EXTINGUISH], int(Action.EXTINGUISH), move)
