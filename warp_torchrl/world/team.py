"""The vehicles: where they start, how they move, put fire out and clear trees."""

from dataclasses import dataclass
from functools import lru_cache
from typing import Literal

import torch
from torch import Tensor

from warp_torchrl.validation import check_fields
from warp_torchrl.world.geometry import DIRECTIONS
from warp_torchrl.world.random import Stream, uniform
from warp_torchrl.world.role import ROLES, RoleTable, role_table
from warp_torchrl.world.start import starting_cells
from warp_torchrl.world.state import (
    FIRST_FIRE,
    Action,
    Cover,
    Outcome,
    Vehicles,
    WorldState,
    is_burning,
    is_tree,
)

_NEIGHBOURHOOD = ((0, 0), (-1, -1), (-1, 0), (-1, 1), (0, -1), (0, 1), (1, -1), (1, 0), (1, 1))


@dataclass(frozen=True, kw_only=True)
class Team:
    """A team of vehicles and its rules (WARP-CA, agents and actions).

    Attributes:
        n_agents: Vehicles.
        roles: Role of each vehicle, repeated as often as needed: ``[ugv, uav]`` alternates.
        allow_stay: Whether there is an eleventh action, stay.
        extinguish_p: Chance that putting a fire out succeeds.
        tank: Extinguish acts that a vehicle carries water for; None is unlimited, 0 none at all. It fills up beside a
            lake and at the corner where the team started.
        start: ``corner`` starts the team in a corner drawn for each episode, ``anywhere`` on cells drawn over the map.

    Raises:
        ValueError: If a value is out of its range or a role is unknown.
    """

    n_agents: int = 4
    roles: tuple[str, ...] = ("ugv",)
    allow_stay: bool = True
    extinguish_p: float = 1.0
    tank: int | None = None
    start: Literal["corner", "anywhere"] = "corner"

    def __post_init__(self) -> None:
        check_fields(self, n_agents=(1, 256), extinguish_p=(0.0, 1.0), tank=(0, 10_000))
        if not self.roles or any(role not in ROLES for role in self.roles):
            raise ValueError(f"roles must be a list of {', '.join(ROLES)}, got {list(self.roles)}")

    @property
    def n_actions(self) -> int:
        """Return the number of actions, 10, or 11 with stay."""
        return 11 if self.allow_stay else 10

    @property
    def action_names(self) -> tuple[str, ...]:
        """Return the names of the actions, ``north`` and so on, by their codes."""
        return tuple(action.name.lower() for action in Action)[: self.n_actions]

    @property
    def agent_roles(self) -> list[str]:
        """Return the role of each agent."""
        return [self.roles[index % len(self.roles)] for index in range(self.n_agents)]

    @property
    def agent_names(self) -> list[str]:
        """Return the names of the agents, ``bulldozer_0`` and so on, numbered within their role."""
        roles = self.agent_roles
        return [f"{ROLES[role].name}_{roles[:index].count(role)}" for index, role in enumerate(roles)]

    def table(self, device: torch.device) -> RoleTable:
        """Return the agents' roles and abilities as tensors of shape [A]."""
        return role_table(tuple(self.agent_roles), device)

    def place(self, key: Tensor, cover: Tensor, burning: Tensor) -> Vehicles:
        """Return the team at the start of an episode; see ``starting_cells``."""
        base, position = starting_cells(key, cover, burning, self.n_agents, self.start)
        counter = torch.zeros(position.shape[:2], dtype=torch.int32, device=cover.device)
        return Vehicles(
            position=position,
            tank=torch.full_like(counter, -1 if self.tank is None else self.tank),
            last_action=torch.full_like(counter, -1, dtype=torch.int64),
            base=base,
            acts=counter,
            redundant=counter.clone(),
            last_useful=torch.full_like(counter, -1),
        )

    def open_moves(self, state: WorldState) -> Tensor:
        """Return which of the eight moves each agent can make, bool [B, A, 8].

        Ground vehicles cannot enter a lake or a burning cell; aircraft fly two cells over anything; nobody leaves
        the map.
        """
        height, width = state.cells.shape[1:]
        roles = self.table(state.cells.device)
        away = _offsets(state.cells.device) * roles.stride[:, None, None]
        index, inside = _places(state.vehicles.position, away, height, width)
        index = index.flatten(1)
        ground, cells = (plane.flatten(1).gather(1, index) for plane in (state.landscape.cover, state.cells))
        blocked = ((ground == int(Cover.LAKE)) | is_burning(cells)).view_as(inside)
        return inside & (~blocked | roles.flies[:, None])

    def nearby_fire(self, state: WorldState, last_spreading: int) -> tuple[Tensor, Tensor]:
        """Return the fire that each agent would put out: the youngest of its 3 x 3 neighbourhood.

        Ties go to the agent's own cell, then in row-major order.

        Returns:
            Flat index of the cell, int64 [B, A], and whether there is one that can be put out, bool [B, A].
        """
        height, width = state.cells.shape[1:]
        index, inside = _places(state.vehicles.position, _neighbourhood(state.cells.device), height, width)
        codes = state.cells.flatten(1).gather(1, index.flatten(1)).view_as(index).to(torch.int64)
        fits = inside & (codes >= FIRST_FIRE) & (codes <= last_spreading)
        order = torch.arange(len(_NEIGHBOURHOOD), device=codes.device)
        best = torch.where(fits, codes * 16 + order, 1 << 20).argmin(dim=-1, keepdim=True)
        return index.gather(-1, best)[..., 0], fits.any(dim=-1)

    def action_mask(self, state: WorldState, last_spreading: int) -> Tensor:
        """Return which actions would do something, bool [B, A, 10 or 11].

        Stay is always open. Without it, an agent that can do nothing at all is shown ``EXTINGUISH``, which then does
        nothing: a policy needs one action to choose.
        """
        _, has_fire = self.nearby_fire(state, last_spreading)
        vehicles = state.vehicles
        own = state.cells.flatten(1).gather(1, self._own_index(state))
        can = [
            self.open_moves(state),
            (has_fire & (vehicles.tank != 0))[..., None],
            (is_tree(own) & self.table(own.device).clears)[..., None],
        ]
        if self.allow_stay:
            can.append(torch.ones_like(can[-1]))
        open_actions = torch.cat(can, dim=-1)
        if not self.allow_stay:
            open_actions[..., Action.EXTINGUISH] |= ~open_actions.any(dim=-1)
        return open_actions

    def act(
        self, state: WorldState, action: Tensor, active: Tensor, last_spreading: int, wet_ticks: int
    ) -> tuple[WorldState, Outcome]:
        """Let the agents move, then let them put out fire and clear trees.

        Two agents at one target: it is done once, credited to the lower index; the other's act counts as redundant.

        Args:
            state: The worlds before the step.
            action: int64 [B, A].
            active: Which worlds go on, bool [B]; elsewhere nothing happens.
            last_spreading: Cell code of the last stage that can be put out.
            wet_ticks: Ticks for which a tree that was put out stays wet.

        Returns:
            The worlds after it, and what each action came to.
        """
        active = active[:, None]
        state, moved = self._move(state, action, active)
        fire_index, has_fire = self.nearby_fire(state, last_spreading)
        own_index = self._own_index(state)
        own = state.cells.flatten(1).gather(1, own_index)
        wants_water = (action == int(Action.EXTINGUISH)) & active
        wants_clear = (action == int(Action.CLEAR)) & active
        has_water = state.vehicles.tank != 0
        hit = wants_water & has_fire & has_water & self._succeeds(state)
        cut = wants_clear & is_tree(own) & self.table(own.device).clears
        target = torch.where(hit, fire_index, own_index)
        redundant = _is_second(target, hit | cut)
        hit_first, cut_first = hit & ~redundant, cut & ~redundant
        vehicles = state.vehicles
        spent = (wants_water & has_fire & (vehicles.tank > 0)).to(torch.int32)
        after = self._apply(state, target, hit_first, cut_first, wet_ticks)
        after = after.replace(
            vehicles=vehicles.replace(
                tank=self._refill(state, vehicles.tank - spent),
                last_action=torch.where(active, action, vehicles.last_action),
                acts=vehicles.acts + (wants_water | wants_clear),
                redundant=vehicles.redundant + redundant,
                last_useful=torch.where(hit_first | cut_first, state.step[:, None], vehicles.last_useful),
            )
        )
        outcome = Outcome(
            action=action,
            moved=moved,
            extinguished=hit_first,
            cleared=cut_first,
            redundant=redundant,
            target=target,
        )
        return after, outcome

    def _move(self, state: WorldState, action: Tensor, active: Tensor) -> tuple[WorldState, Tensor]:
        direction = action.clamp(max=7)
        is_open = self.open_moves(state).gather(-1, direction[..., None])[..., 0]
        moved = is_open & (action < len(DIRECTIONS)) & active
        roles = self.table(action.device)
        stride = (roles.stride * moved)[..., None]
        position = state.vehicles.position + _offsets(action.device)[direction] * stride
        return state.replace(vehicles=state.vehicles.replace(position=position)), moved

    def _succeeds(self, state: WorldState) -> Tensor | bool:
        if self.extinguish_p == 1.0:
            return True
        return uniform(state.key, state.step, Stream.ACTION, (self.n_agents,)) < self.extinguish_p

    def _refill(self, state: WorldState, tank: Tensor) -> Tensor:
        """Fill the tanks of vehicles beside a lake or at the base."""
        if self.tank is None:
            return tank
        height, width = state.cells.shape[1:]
        position = state.vehicles.position
        index, inside = _places(position, _neighbourhood(tank.device), height, width)
        cover = state.landscape.cover.flatten(1).gather(1, index.flatten(1)).view_as(index)
        by_lake = ((cover == int(Cover.LAKE)) & inside).any(dim=-1)
        at_base = (position == state.vehicles.base[:, None]).all(dim=-1)
        return torch.where(by_lake | at_base, self.tank, tank)

    @staticmethod
    def _apply(state: WorldState, target: Tensor, hit: Tensor, cut: Tensor, wet_ticks: int) -> WorldState:
        """Write the credited acts into the maps, as sums of differences so that their order does not matter."""

        def add(plane: Tensor, difference: Tensor) -> Tensor:
            codes = plane.view(torch.uint8).flatten(1)
            return codes.scatter_add(1, target, difference.to(torch.uint8)).view_as(plane).view(plane.dtype)

        def there(plane: Tensor) -> Tensor:
            return plane.view(torch.uint8).flatten(1).gather(1, target)

        old, age = there(state.cells), there(state.age)
        return state.replace(
            cells=add(state.cells, hit * (age - old) - cut * old),
            age=add(state.age, -(hit * age)),
            extinguished=add(state.extinguished, hit * (1 - there(state.extinguished))),
            firebreak=add(state.firebreak, cut),
            wet=add(state.wet, hit * (wet_ticks - there(state.wet))),
        )

    @staticmethod
    def _own_index(state: WorldState) -> Tensor:
        position = state.vehicles.position
        return position[..., 0] * state.cells.shape[2] + position[..., 1]


def _is_second(target: Tensor, acting: Tensor) -> Tensor:
    """Return which agents act on a target that an acting agent of lower index has, bool [B, A]."""
    same = (target[:, :, None] == target[:, None, :]) & acting[:, :, None] & acting[:, None, :]
    return same.tril(diagonal=-1).any(dim=-1)


def _places(position: Tensor, away: Tensor, height: int, width: int) -> tuple[Tensor, Tensor]:
    """Return where places about the agents are, row * W + column, and which of them are on the map.

    Those off the map are moved to its edge.

    Args:
        position: int64 [B, A, 2] [cells].
        away: (rows, columns) from an agent to each, int64 [n, 2] or [A, n, 2] [cells].
        height: H of the map [cells].
        width: W.

    Returns:
        int64 [B, A, n] and bool [B, A, n].
    """
    row, column = position[..., 0, None] + away[..., 0], position[..., 1, None] + away[..., 1]
    on_row, on_column = row.clamp(0, height - 1), column.clamp(0, width - 1)
    return on_row * width + on_column, (on_row == row) & (on_column == column)


@lru_cache(maxsize=8)
def _offsets(device: torch.device) -> Tensor:
    return torch.tensor(DIRECTIONS, device=device)


@lru_cache(maxsize=8)
def _neighbourhood(device: torch.device) -> Tensor:
    return torch.tensor(_NEIGHBOURHOOD, device=device)
