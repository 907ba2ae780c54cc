"""Policies without learning, the yardsticks. Each is usable wherever a policy is: tensordict in, action out.

They read the worlds through the environment: all but ``local`` see every cell, which no learned policy does.
"""

import torch
from tensordict import TensorDictBase
from tensordict.nn import TensorDictModuleBase
from torch import Tensor

from warp_torchrl.env import WildfireEnv
from warp_torchrl.world.geometry import DIRECTIONS, FAR, chebyshev_distance
from warp_torchrl.world.random import Stream, uniform
from warp_torchrl.world.state import Action, WorldState, is_burning


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


class NoOp(Heuristic):
    """Does nothing: stays, or where the team cannot stay, chooses an action that has no effect."""

    def choose(self, state: WorldState, mask: Tensor) -> Tensor:
        """Return the actions, int64 [B, A]."""
        if mask.shape[-1] > Action.STAY:
            return torch.full(mask.shape[:-1], int(Action.STAY), device=mask.device)
        return mask.to(torch.uint8).argmin(dim=-1)


class Random(Heuristic):
    """Draws one of the actions that do something, the same ones on the same seed."""

    def choose(self, state: WorldState, mask: Tensor) -> Tensor:
        """Return the actions, int64 [B, A]."""
        draws = uniform(state.key, state.step, Stream.POLICY, tuple(mask.shape[1:]))
        return (draws + 1.0).mul_(mask).argmax(dim=-1)


class Local(Heuristic):
    """Sees only the square of ``radius`` cells about itself: puts out what it can reach, else goes to the nearest
    fire it sees, else sweeps the map, first fanning out across it and then from one random point to the next.
    """

    radius = 5

    def choose(self, state: WorldState, mask: Tensor) -> Tensor:
        """Return the actions, int64 [B, A]."""
        fire = _can_be_put_out(state, self.env)
        distance, index = _nearest_fire(state, fire)
        sees = distance <= self.radius
        target = torch.where(sees[..., None], _place(index, state), self._waypoint(state))
        return _extinguish_or(_approach(state, self.env, target), mask)

    def _waypoint(self, state: WorldState) -> Tensor:
        """Return where each agent sweeps to, int64 [B, A, 2]: fanning out over the map, later random points."""
        size = torch.tensor(state.cells.shape[1:], device=state.cells.device)
        agents = state.vehicles.position.shape[1]
        leg = state.step // size.max()
        anywhere = uniform(state.key, leg, Stream.POLICY, (agents, 2))
        turn = (torch.arange(agents, device=size.device) + 0.5) / agents
        across = torch.stack((2.0 * turn, 2.0 - 2.0 * turn), dim=-1).clamp_(max=1.0)
        across = torch.where(state.vehicles.base[:, None] > 0, 1.0 - across, across)
        point = torch.where((leg == 0)[:, None, None], across, anywhere)
        return (point * (size - 1)).round_().to(torch.int64)


class Greedy(Heuristic):
    """Puts out what it can reach, else goes to the nearest fire of the map."""

    def choose(self, state: WorldState, mask: Tensor) -> Tensor:
        """Return the actions, int64 [B, A]."""
        _, index = _nearest_fire(state, _can_be_put_out(state, self.env))
        return _extinguish_or(_approach(state, self.env, _place(index, state)), mask)


class Coordinated(Heuristic):
    """Shares the front out: agents claim distinct cells of it by distance and threat, so that they spread round the
    fire and its head is attacked first; on the way, and there, they put out what they can reach.

    A claim is made for one agent after the other, in as many rounds as there are agents: each round takes the best
    pair of an agent without a claim and a cell, and discounts the cells about it for the others.
    """

    eagerness = 6.0  # cells of way that a full threat is worth
    elbow_room = 3  # cells about a claim that the others avoid
    discount = 6.0  # cells of way that avoiding them is worth
    taken = 1000.0  # ... and the claimed cell itself, while another one burns

    def choose(self, state: WorldState, mask: Tensor) -> Tensor:
        """Return the actions, int64 [B, A]."""
        fire = _can_be_put_out(state, self.env)
        threat = self.env.world.threat(state)
        front = fire & (threat > 0.01)
        front = torch.where(front.flatten(1).any(1)[:, None, None], front, fire)
        value = (self.eagerness * threat).masked_fill(~front, -float(FAR))
        target = self._claims(state, value)
        return _extinguish_or(_approach(state, self.env, target), mask)

    def _claims(self, state: WorldState, value: Tensor) -> Tensor:
        """Return the cell that each agent claims, int64 [B, A, 2]."""
        position = state.vehicles.position
        worlds, agents = position.shape[:2]
        everywhere = torch.ones_like(value, dtype=torch.bool)
        gain = value[:, None] - chebyshev_distance(position, everywhere)
        claim = torch.zeros(worlds, agents, dtype=torch.int64, device=value.device)
        for _ in range(agents):
            best = gain.flatten(1).argmax(dim=1)
            agent, cell = best // value[0].numel(), best % value[0].numel()
            claim.scatter_(1, agent[:, None], cell[:, None])
            distance = chebyshev_distance(_place(cell[:, None], state), everywhere)
            gain = gain - self.discount * (distance <= self.elbow_room) - self.taken * (distance == 0)
            gain.scatter_(1, agent[:, None, None, None].expand(-1, 1, *value.shape[1:]), -2.0 * FAR)
        return _place(claim, state)


HEURISTICS: dict[str, type[Heuristic]] = {
    "noop": NoOp,
    "random": Random,
    "local": Local,
    "greedy": Greedy,
    "coordinated": Coordinated,
}
"""Policies by name."""


def _can_be_put_out(state: WorldState, env: WildfireEnv) -> Tensor:
    return is_burning(state.cells) & (state.cells <= env.world.fire.last_spreading)


def _nearest_fire(state: WorldState, fire: Tensor) -> tuple[Tensor, Tensor]:
    """Return each agent's distance to the nearest fire, float32 [B, A], and its flat index, int64 [B, A].

    Equally near ones are told apart by a draw of each agent's own: agents that stand together and see the same would
    otherwise do the same for ever.
    """
    distance = chebyshev_distance(state.vehicles.position, fire).flatten(2)
    taste = uniform(state.key, 0, Stream.POLICY, tuple(distance.shape[1:]))
    best = (distance + taste).min(dim=-1)
    return best.values.floor(), best.indices


def _place(index: Tensor, state: WorldState) -> Tensor:
    """Return (row, column) of a flat index, int64 [..., 2]."""
    width = state.cells.shape[2]
    return torch.stack((index // width, index % width), dim=-1)


def _approach(state: WorldState, env: WildfireEnv, target: Tensor) -> Tensor:
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


def _extinguish_or(move: Tensor, mask: Tensor) -> Tensor:
    """Return extinguish where it is open, else the move."""
    return torch.where(mask[..., Action.EXTINGUISH], int(Action.EXTINGUISH), move)
