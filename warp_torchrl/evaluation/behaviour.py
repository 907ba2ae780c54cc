"""Measures of a team's behaviour: division of labour, head attack, contested targets, containment and firebreaks."""

import numpy as np
import torch
from torch import Tensor

from warp_torchrl.world.arrays.geometry import grow
from warp_torchrl.world.state.cells import is_burning, is_tree
from warp_torchrl.world.state.front import alignment, centre, containment, sector
from warp_torchrl.world.state.state import Transition, WorldState

SECTORS = 8
SHUFFLES = 64
BEHAVIOUR = ("division", "head_attack", "contested", "containment", "lead_time", "unused_breaks")
"""Names of the measures, in the order of tables."""


class Behaviour:
    """Measures one episode of each world; assign it to ``WildfireEnv.watcher``.

    Args:
        state: The initial worlds.
    """

    def __init__(self, state: WorldState) -> None:
        worlds, agents = state.vehicles.position.shape[:2]
        device = state.cells.device
        self._counts = torch.zeros(worlds, agents, SECTORS, device=device)
        self._cosine = torch.zeros(worlds, device=device)
        self._acts = torch.zeros(worlds, device=device)
        self._contested = torch.zeros(worlds, device=device)
        self._targets = torch.zeros(worlds, device=device)
        self._cleared_at = torch.full(state.cells.shape, -1, dtype=torch.int32, device=device)
        self._lead = torch.full(state.cells.shape, -1, dtype=torch.int32, device=device)
        self._state = state.clone()

    def __call__(self, transition: Transition, rows: Tensor | None = None) -> None:
        """Count one step.

        Args:
            transition: Of all worlds, or of some.
            rows: Which they are, int64 [n] in order; None, all.
        """
        if rows is not None and len(rows) < len(self._acts):
            self._count_some(transition, rows)
            return
        before, after, result = transition.before, transition.after, transition.result
        width = before.cells.shape[2]
        place = torch.stack((result.target // width, result.target % width), dim=-1)
        middle = centre(is_burning(before.cells))
        acted = (result.extinguished | result.cleared).to(torch.float32)
        put_out = result.extinguished.to(torch.float32)
        self._counts.scatter_add_(2, sector(place, middle, SECTORS)[..., None], acted[..., None])
        self._cosine += (alignment(place, middle, before.wind) * acted).sum(dim=1)
        self._acts += acted.sum(dim=1)
        self._targets += put_out.sum(dim=1)
        self._contested += _contested(result.target, result.extinguished, result.redundant)
        new = after.firebreak & ~before.firebreak
        step = before.step[:, None, None]
        self._cleared_at = torch.where(new, step, self._cleared_at)
        reached = grow(is_burning(after.cells)) & (self._cleared_at >= 0) & (self._lead < 0)
        self._lead = torch.where(reached, step - self._cleared_at, self._lead)
        self._state = after

    def _count_some(self, transition: Transition, rows: Tensor) -> None:
        some = Behaviour(transition.before)
        for name, value in vars(self).items():
            if isinstance(value, Tensor):
                setattr(some, name, value.index_select(0, rows))
        some(transition)
        for name, value in vars(self).items():
            if isinstance(value, Tensor):
                value.index_copy_(0, rows, getattr(some, name))
        self._state[rows] = some._state

    def summary(self) -> dict[str, np.ndarray]:
        """Return the measures of each world's episode, float64 [B]; NaN where an episode has no value.

        ``division``: mutual information of agent and sector of the fire over credited acts, minus its mean when the
        sectors are shuffled among the acts [bits]. ``head_attack``: mean cosine between the wind and the direction
        from the fire's centre to the act. ``contested``: share of extinguished cells that a team-mate targeted in the
        same step. ``containment``: share of rays from the centre of all burned and extinguished cells to the border
        that meet a firebreak or a standing extinguished tree. ``lead_time``: steps from a clearing until fire is
        adjacent to it. ``unused_breaks``: share of clearings that fire never reached.
        """
        state = self._state
        touched = is_burning(state.cells) | state.burned | state.extinguished
        barrier = state.firebreak | (state.extinguished & is_tree(state.cells))
        cleared = self._cleared_at >= 0
        reached = self._lead >= 0
        count, used = cleared.sum((1, 2)), reached.sum((1, 2))
        numbers = {
            "head_attack": self._cosine / self._acts,
            "contested": self._contested / self._targets,
            "containment": containment(touched, barrier),
            "lead_time": (self._lead * reached).sum((1, 2)) / used,
            "unused_breaks": 1.0 - used / count,
        }
        found = {name: value.double().cpu().numpy() for name, value in numbers.items()}
        return {"division": division_of_labour(self._counts.cpu().numpy())} | found


def _contested(target: Tensor, extinguished: Tensor, redundant: Tensor) -> Tensor:
    """Return the number of extinguished cells that a team-mate targeted too, float32 [B]."""
    same = (target[:, :, None] == target[:, None, :]) & extinguished[:, :, None] & redundant[:, None, :]
    return same.any(dim=2).to(torch.float32).sum(dim=1)


def mutual_information(counts: np.ndarray) -> np.ndarray:
    """Return the mutual information of row and column in tables of counts [..., rows, columns], [...] [bits]."""
    share = counts / np.maximum(counts.sum((-2, -1), keepdims=True), 1.0)
    alone = share.sum(-1, keepdims=True) * share.sum(-2, keepdims=True)
    ratio = np.divide(share, alone, out=np.ones_like(share), where=share > 0.0)
    return (share * np.log2(ratio)).sum((-2, -1))


def division_of_labour(counts: np.ndarray) -> np.ndarray:
    """Return the mutual information of agent and sector above chance, float64 [B] [bits].

    Mutual information of small tables is above 0 by chance; the mean over shuffled tables with the same margins is
    subtracted.

    Args:
        counts: Acts by agent and sector, [B, A, sectors].
    """
    random, excess = np.random.default_rng(0), np.full(len(counts), np.nan)
    for world, table in enumerate(counts.astype(np.int64)):
        agents, sectors = table.sum(1), table.sum(0)
        if agents.sum() < 2 or len(agents) < 2:
            continue
        shuffled = np.zeros((SHUFFLES, *table.shape))
        left = np.broadcast_to(sectors, (SHUFFLES, len(sectors))).copy()
        shuffled[:, 0] = random.multivariate_hypergeometric(sectors, agents[0], size=SHUFFLES)
        left -= shuffled[:, 0].astype(np.int64)
        for agent, acts in enumerate(agents[1:], start=1):
            for draw in range(SHUFFLES):
                taken = random.multivariate_hypergeometric(left[draw], acts)
                shuffled[draw, agent] = taken
                left[draw] -= taken
        excess[world] = mutual_information(table.astype(float)) - mutual_information(shuffled).mean()
    return excess
