"""Knowledge: what agents know of the fire and of each other, and believe. A mechanic may limit it, or add to it."""

from abc import ABC, abstractmethod
from dataclasses import dataclass

import torch
from torch import Tensor

from warp_torchrl.system.modes import kept
from warp_torchrl.world.state.state import WorldState
from warp_torchrl.world.team.hearing import Hearing
from warp_torchrl.world.team.presence import pairs_there
from warp_torchrl.world.team.team import Team

_EVERYWHERE = 1 << 20
"""A sight that no map limits [cells]."""


@dataclass(frozen=True, kw_only=True)
class Sensing(ABC):
    """What the world, observations and heuristics need of a sensing component.

    One that limits what agents know is a mechanic too, and keeps their maps in the worlds, see ``world.state.records``.
    """

    @property
    @abstractmethod
    def is_limited(self) -> bool:
        """Return whether something may burn that agents do not know of."""

    @abstractmethod
    def reach(self, team: Team) -> list[int]:
        """Return how far each agent sees [cells]."""

    @property
    def errors(self) -> tuple[float, float]:
        """Return the chances that a fire in sight is taken for a tree, and a tree for a fire."""
        return 0.0, 0.0

    @abstractmethod
    def knows_where(self, state: WorldState, team: Team, hearing: Hearing) -> tuple[Tensor, Tensor]:
        """Return of which others each agent knows where they are, bool [B or 1, A, A], and what it takes for that.

        The places are int64 [B, A or 1, A, 2], (row, column) [cells]: [b, i, j] is where agent i takes agent j to be.
        """

    def signs(self, state: WorldState, team: Team, known: Tensor) -> Tensor | None:
        """Return how much points to a fire at each cell that is not known, float32 [B, G, H, W] in 0..1.

        None where nothing does.

        Args:
            state: The worlds.
            team: The vehicles.
            known: How likely each cell burns by the fires that are known, float32 [B, G, H, W]: to the team, or to each
                agent.
        """
        return None


@dataclass(frozen=True, kw_only=True)
class Full(Sensing):
    """Agents are shown the fire as it is, as far as their observation reaches."""

    @property
    def is_limited(self) -> bool:
        """Return that it is not."""
        return False

    def reach(self, team: Team) -> list[int]:
        """Return more than any map is long [cells]."""
        return [_EVERYWHERE] * team.n_agents

    def knows_where(self, state: WorldState, team: Team, hearing: Hearing) -> tuple[Tensor, Tensor]:
        """Return that each knows where all others are, bool [B or 1, A, A], and where they are, int64 [B, 1, A, 2]."""
        others = _others(team.n_agents, state.cells.device)
        return pairs_there(state, others), state.vehicles.position[:, None]


@kept(32)
def _others(agents: int, device: torch.device) -> Tensor:
    """Return for each agent which are the others, bool [1, A, A]."""
    return ~torch.eye(agents, dtype=torch.bool, device=device)[None]


@dataclass(frozen=True, kw_only=True)
class Belief:
    """Agents believe of the fire what they know, and nothing more; a mechanic that is a ``Belief`` too adds to it."""
