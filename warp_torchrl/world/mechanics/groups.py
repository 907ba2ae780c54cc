"""The groups that a team's vehicles form: one that serves all land, or those of agencies."""

from abc import ABC, abstractmethod
from dataclasses import dataclass
from typing import ClassVar

from torch import Tensor

from warp_torchrl.world.mechanics.mechanic import Mechanic
from warp_torchrl.world.state.state import WorldState
from warp_torchrl.world.team.team import Team


@dataclass(frozen=True, kw_only=True)
class Agencies(Mechanic, ABC):
    """What the world needs of a component that says which vehicles serve which land."""

    name: ClassVar[str] = "agencies"

    @property
    @abstractmethod
    def names(self) -> tuple[str, ...]:
        """Return the agencies' names; none where the whole team serves all land."""

    @abstractmethod
    def groups(self, team: Team) -> dict[str, list[int]]:
        """Return the vehicles of each group by their index: those of each agency, then those of the pool."""

    def serves(self, state: WorldState) -> Tensor | None:
        """Return the agency that each vehicle serves, int64 [B, A]; None where there is but one."""
        return None

    def own_land(self, state: WorldState) -> Tensor | None:
        """Return the cells of the agency that each vehicle serves, bool [B, A, H, W]; None where there is but one."""
        return None


@dataclass(frozen=True, kw_only=True)
class OneAgency(Agencies):
    """The whole team serves all land."""

    @property
    def names(self) -> tuple[str, ...]:
        """Return no name."""
        return ()

    def groups(self, team: Team) -> dict[str, list[int]]:
        """Return the team, ``agents``."""
        return {"agents": list(range(team.n_agents))}
