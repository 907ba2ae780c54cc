"""The turn of a team's radio in the loop: packets set out before agents look, and are told."""

from dataclasses import dataclass
from typing import ClassVar

from torch import Tensor

from warp_torchrl.world.mechanics.mechanic import Mechanic, Rules
from warp_torchrl.world.state.state import WorldState
from warp_torchrl.world.team.radio import UNDER_WAY


@dataclass(frozen=True, kw_only=True)
class RadioTurn(Mechanic):
    """Sends the packets of ``team.radio``, whose rules are the team's."""

    name: ClassVar[str] = UNDER_WAY

    def begin(self, state: WorldState, world: Rules) -> WorldState:
        """Return worlds with the packets that set out at the start of an episode."""
        return world.team.radio.begun(state, world.team.table(state.cells.device).flies)

    def step(self, before: WorldState, after: WorldState, running: Tensor, world: Rules) -> WorldState:
        """Return worlds after a step with the packets that set out then."""
        return world.team.radio.sent(after, world.team.table(after.cells.device).flies, running)
