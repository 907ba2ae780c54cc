"""Aircraft that drop retardant wherever they fly over fire (Haksar and Schwager, IROS 2018).

Retardant is no action: an aircraft that is over a burning tree treats it, whatever it chose. The tree goes on burning,
and is less likely to after the next tick (``warp_torchrl.world.law.lattice``).
"""

from dataclasses import dataclass
from typing import ClassVar, Literal

import torch
from torch import Tensor

from warp_torchrl.validation import check_fields
from warp_torchrl.world.arrays.batch import Batch
from warp_torchrl.world.mechanics.mechanic import Mechanic, Rules
from warp_torchrl.world.state.cells import is_burning
from warp_torchrl.world.state.role import Role, add_role
from warp_torchrl.world.state.state import ActionResult, WorldState
from warp_torchrl.world.team.abilities import own_cell
from warp_torchrl.world.team.acting import Attempts, TakeEffect, changed, is_second
from warp_torchrl.world.team.places import approach_move, has_reached
from warp_torchrl.world.team.presence import those_there
from warp_torchrl.world.team.team import Team

TANKER = "tanker"
"""The role of these aircraft."""
add_role(TANKER, Role(TANKER, abilities=("move",), flies=True))

_BASE = 5
"""The base is in this row from the south and this column from the west, from 1."""


@dataclass(eq=False, repr=False)
class Missions(Batch):
    """How far aircraft have come since they set out."""

    arrived: Tensor  # bool [B,A], was over the fire


@dataclass(frozen=True, kw_only=True)
class RetardantTeam(Team, Mechanic):
    """A team whose aircraft, role ``tanker``, treat the burning trees that they fly over.

    In each step an aircraft moves to one of the eight cells about it, or stays. It treats the burning tree that it
    leaves and the one that it comes to; each takes one of its ``tank``. With the last it is back at its base at once,
    five cells from the south-west corner, with a full tank. It starts anywhere.

    Attributes:
        treats: ``path`` treats the tree that an aircraft leaves and the one that it comes to, as the program has it of
            which the authors' results are; ``end`` the latter alone, as their later program has it.
        approach: Whether aircraft that have not reached the fire since they set out are shown one action alone, the
            move towards the middle of the map: learned policies then act at the fire only, as the authors' do.

    Raises:
        ValueError: If a value is out of its range or a role is unknown.
    """

    name: ClassVar[str] = "retardant"

    n_agents: int = 10
    roles: tuple[str, ...] = (TANKER,)
    start: Literal["corner", "anywhere"] = "anywhere"
    treats: Literal["path", "end"] = "path"
    approach: bool = False

    def __post_init__(self) -> None:
        super().__post_init__()
        check_fields(self)

    def begin(self, state: WorldState, world: Rules) -> WorldState:
        """Return worlds whose aircraft have not reached the fire; their base is near the south-west corner."""
        vehicles, (height, width) = state.vehicles, state.cells.shape[1:]
        if self.start != "corner":
            row, column = max(height - _BASE, 0), min(_BASE, width) - 1
            axis = torch.arange(2, device=state.cells.device)
            base = torch.where(axis == 0, row, column).expand_as(vehicles.base).contiguous()
            state = state.replace(vehicles=vehicles.replace(base=base))
        return state.with_planes(self.name, Missions(torch.zeros_like(vehicles.tank, dtype=torch.bool)))

    def masked(self, state: WorldState, mask: Tensor) -> Tensor:
        """Return which actions are open, bool [B, A, actions]; of aircraft on their way to the fire it is one."""
        if not self.approach:
            return mask
        actions = torch.arange(mask.shape[-1], device=mask.device)
        alone = actions == approach_move(state)[..., None]
        sets_out = self._drops(state.cells.device) & ~has_reached(state)
        return torch.where(sets_out[..., None], alone, mask)

    def around(self, state: WorldState, attempts: Attempts, take_effect: TakeEffect) -> tuple[WorldState, ActionResult]:
        """Let the vehicles do as in any team, and the aircraft drop their retardant before and after it.

        An aircraft that treats a tree is credited for it, unless it was treated in this tick already: then that was
        redundant.
        """
        drops, step = those_there(state, self._drops(state.cells.device) & attempts.running), state.step
        before = state.replace(vehicles=state.vehicles.replace(position=attempts.origin))
        target, reached = own_cell(before), has_reached(before) & attempts.running
        treated = first = torch.zeros_like(drops)
        if self.treats == "path":
            state, treated, first = _treat(state, target, drops)
        state, result = take_effect(state, attempts)
        comes = drops & result.moved if self.treats == "path" else drops
        state, ends, new = _treat(state, own_cell(state), comes)
        treated, first = treated | ends, first | new
        target = torch.where(drops, torch.where(ends, own_cell(state), target), result.target)
        redundant, vehicles = treated & ~first, state.vehicles
        vehicles = vehicles.replace(
            acts=vehicles.acts + treated,
            redundant=vehicles.redundant + redundant,
            last_useful=torch.where(first, step[:, None], vehicles.last_useful),
        )
        arrived = reached | state.planes(self.name, Missions).arrived
        return self._sent_back(state.replace(vehicles=vehicles), drops, arrived), result.replace(
            credited=result.credited | first, redundant=result.redundant | redundant, target=target
        )

    def _sent_back(self, state: WorldState, drops: Tensor, arrived: Tensor) -> WorldState:
        """Return worlds in which those that dropped their last are at the base, with full tanks, and set out again.

        Args:
            state: The worlds after all acts.
            drops: Which vehicles drop retardant, bool [B, A].
            arrived: Which have been over the fire since they set out, bool [B, A].
        """
        if not self.tank:
            return state.with_planes(self.name, Missions(arrived))
        vehicles = state.vehicles
        empty = drops & (vehicles.tank == 0)
        vehicles = vehicles.replace(
            position=torch.where(empty[..., None], vehicles.base[:, None], vehicles.position),
            tank=torch.where(empty, self.tank, vehicles.tank),
        )
        return state.replace(vehicles=vehicles).with_planes(self.name, Missions(arrived & ~empty))

    def _drops(self, device: torch.device) -> Tensor:
        """Return which vehicles drop retardant, bool [A]."""
        names = self.role_names
        return self.table(device).index == (names.index(TANKER) if TANKER in names else -1)


def _treat(state: WorldState, cell: Tensor, drops: Tensor) -> tuple[WorldState, Tensor, Tensor]:
    """Return worlds in which vehicles treated burning cells.

    Args:
        state: The worlds.
        cell: Flat index of the cell of each, int64 [B, A].
        drops: Which vehicles would, bool [B, A].

    Returns:
        The worlds, which vehicles treated a tree, and which were the first to do so in this tick, bool [B, A] each.
    """
    tank = state.vehicles.tank
    treated = drops & is_burning(state.cells.flatten(1).gather(1, cell)) & (tank != 0)
    first = treated & (state.wet.flatten(1).gather(1, cell) == 0)
    first = first & ~is_second(cell, first)
    after = changed(state, cell, [(first, {"wet": 1})])
    left = tank - (treated & (tank > 0)).to(torch.int32)
    return after.replace(vehicles=after.vehicles.replace(tank=left)), treated, first
