"""The vehicles: where they start, and how a step makes one of what each of them does."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property, reduce
from operator import add, or_
from typing import Literal, NamedTuple, Protocol

import torch
from torch import Tensor

from warp_torchrl.validation import check_fields
from warp_torchrl.world.arrays.bytes import scatter_add
from warp_torchrl.world.state.role import ROLES, RoleTable, role_names, role_table
from warp_torchrl.world.state.state import Action, ActionResult, Cover, Vehicles, WorldState
from warp_torchrl.world.team.abilities import ABILITIES, PAPER_ABILITIES, Ability, Deed, Situation, neighbourhood
from warp_torchrl.world.team.start import starting_cells

STAY = "stay"
"""Name of the action that does nothing."""


class Skill(NamedTuple):
    """An ability of a team."""

    name: str
    ability: Ability
    first: int  # code of its first action
    of_all: bool  # whether every agent has it

    def is_chosen(self, action: Tensor) -> Tensor:
        """Return where an action is one of its own, bool, shape of the actions, int64."""
        count = len(self.ability.actions)
        if count == 1:
            return action == self.first
        below = action < self.first + count
        return below & (action >= self.first) if self.first else below

    def act(self, now: Situation, action: Tensor) -> tuple[Tensor, Deed]:
        """Return which agents would do something if their action is one of its own, bool [B, A], and what."""
        count = len(self.ability.actions)
        choice = (action - self.first if self.first else action).clamp(0, count - 1) if count > 1 else action
        deed = self.ability.act(now, choice)
        return deed.possible if self.of_all else deed.possible & now.roles.can[self.name], deed


class MoveRule(Protocol):
    """What binds vehicles that move, beside their abilities; see ``world.mechanics.Mechanic``."""

    def grounded(self, state: WorldState, roles: RoleTable) -> Tensor | None:
        """Return which agents cannot move, bool [B, A]; None where it keeps none."""
        ...

    def moved(self, state: WorldState, roles: RoleTable, running: Tensor) -> WorldState:
        """Return worlds after the agents' moves, in those that go on, bool [B]."""
        ...


@dataclass(frozen=True, kw_only=True)
class Team:
    """A team of vehicles and its rules (WARP-CA, agents and actions).

    Attributes:
        n_agents: Vehicles.
        roles: Role of each vehicle, repeated as often as needed: ``[ugv, uav]`` alternates.
        allow_stay: Whether there is an action that does nothing, stay.
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
        unknown = {name for role in self.roles for name in ROLES[role].abilities} - ABILITIES.keys()
        if unknown:
            raise ValueError(f"abilities of a role must be of {', '.join(ABILITIES)}, got {', '.join(sorted(unknown))}")

    @property
    def n_actions(self) -> int:
        """Return the number of actions."""
        return len(self.action_names)

    @cached_property
    def action_names(self) -> tuple[str, ...]:
        """Return the names of the actions, ``north`` and so on, by their codes.

        The paper's ten come first, then ``stay`` where it is allowed, then those of the other abilities of its roles.
        """
        paper = tuple(action for name in PAPER_ABILITIES for action in ABILITIES[name].actions)
        return (*paper, *([STAY] if self.allow_stay else ()), *self.further_actions)

    @cached_property
    def further_actions(self) -> tuple[str, ...]:
        """Return the names of the actions that are not the paper's, nor stay."""
        return tuple(action for name in self._further for action in ABILITIES[name].actions)

    @property
    def _further(self) -> list[str]:
        named = (name for role in self.roles for name in ROLES[role].abilities)
        return [name for name in dict.fromkeys(named) if name not in PAPER_ABILITIES]

    @cached_property
    def skills(self) -> tuple[Skill, ...]:
        """Return the abilities of the team, in the order of its actions."""
        names, codes = (*PAPER_ABILITIES, *self._further), self.action_names
        kinds = [ROLES[role] for role in self.roles]
        return tuple(
            Skill(name, made, codes.index(made.actions[0]), all(name in kind.abilities for kind in kinds))
            for name, made in ((name, ABILITIES[name]) for name in names)
        )

    @cached_property
    def role_names(self) -> tuple[str, ...]:
        """Return the roles by their index: the paper's two, then the team's others."""
        return role_names(self.roles)

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
        return role_table(*self._named, device)

    @cached_property
    def _named(self) -> tuple[tuple[str, ...], ...]:
        return tuple(self.agent_roles), self.role_names, tuple(skill.name for skill in self.skills)

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

    def open_moves(self, state: WorldState, rules: Sequence[MoveRule] = ()) -> Tensor:
        """Return which of the eight moves each agent can make under some rules, bool [B, A, 8]."""
        return self._mask(self.skills[0], self._situation(state, 0), rules)

    def action_mask(self, state: WorldState, last_spreading: int, rules: Sequence[MoveRule] = ()) -> Tensor:
        """Return which actions would do something, bool [B, A, actions].

        Stay is always open. Without it, an agent that can do nothing at all is shown ``EXTINGUISH``, which then does
        nothing: a policy needs one action to choose.

        Args:
            state: The worlds.
            last_spreading: Cell code of the last stage that can be put out.
            rules: What binds moves.
        """
        now = self._situation(state, last_spreading)
        can = [self._mask(skill, now, rules) for skill in self.skills]
        if self.allow_stay:
            can.insert(len(PAPER_ABILITIES), torch.ones_like(can[-1][..., :1]))
        open_actions = torch.cat(can, dim=-1)
        if not self.allow_stay:
            open_actions[..., Action.EXTINGUISH] |= ~open_actions.any(dim=-1)
        return open_actions

    def act(
        self,
        state: WorldState,
        action: Tensor,
        running: Tensor,
        last_spreading: int,
        wet_ticks: int,
        rules: Sequence[MoveRule] = (),
    ) -> tuple[WorldState, ActionResult]:
        """Let the agents move, then let them put out fire, clear trees, and do what else their roles can.

        Two agents at one target: it is done once, credited to the lower index; the other's act counts as redundant.

        Args:
            state: The worlds before the step.
            action: int64 [B, A].
            running: Which worlds go on, bool [B]; elsewhere nothing happens.
            last_spreading: Cell code of the last stage that can be put out.
            wet_ticks: Ticks for which a tree that was put out stays wet.
            rules: What binds moves.

        Returns:
            The worlds after it, and what each action came to.
        """
        state, moved = self._move(state, action, running, rules)
        running = running[:, None]
        now = self._situation(state, last_spreading, wet_ticks)
        target = now.own_cell
        vehicles, tank = state.vehicles, state.vehicles.tank
        chosen, deeds = [], []
        for skill in self.skills:
            if skill.ability.moves:
                continue
            wanted = skill.is_chosen(action) & running
            possible, deed = skill.act(now, action)
            done = wanted & possible
            if deed.target is not None:
                target = torch.where(done, deed.target, target)
            if deed.takes_water is not None:
                tank = tank - (wanted & deed.takes_water & (vehicles.tank > 0)).to(torch.int32)
            chosen.append(wanted)
            deeds.append((done, deed.becomes))
        acting = reduce(or_, [done for done, _ in deeds])
        redundant = is_second(target, acting)
        credited = acting & ~redundant
        after = changed(state, target, [(done & credited, becomes) for done, becomes in deeds])
        after = after.replace(
            vehicles=vehicles.replace(
                tank=self._refill(state, tank),
                last_action=torch.where(running, action, vehicles.last_action),
                acts=vehicles.acts + reduce(or_, chosen),
                redundant=vehicles.redundant + redundant,
                last_useful=torch.where(credited, state.step[:, None], vehicles.last_useful),
            )
        )
        return after, ActionResult(action=action, moved=moved, credited=credited, redundant=redundant, target=target)

    def _situation(self, state: WorldState, last_spreading: int, wet_ticks: int = 0) -> Situation:
        return Situation(state, self.table(state.cells.device), self.extinguish_p, last_spreading, wet_ticks)

    def _mask(self, skill: Skill, now: Situation, rules: Sequence[MoveRule]) -> Tensor:
        mask = skill.ability.mask(now)
        if skill.ability.moves:
            for grounded in _grounded(now, rules):
                mask = mask & ~grounded[..., None]
        return mask if skill.of_all else mask & now.roles.can[skill.name][:, None]

    def _move(
        self, state: WorldState, action: Tensor, running: Tensor, rules: Sequence[MoveRule]
    ) -> tuple[WorldState, Tensor]:
        """Return the worlds after the moves, and which agents moved, bool [B, A]."""
        now, position, moved = self._situation(state, 0), state.vehicles.position, []
        for skill in self.skills:
            if skill.ability.moves:
                possible, deed = skill.act(now, action)
                for grounded in _grounded(now, rules):
                    possible = possible & ~grounded
                moved.append(skill.is_chosen(action) & running[:, None] & possible)
                if deed.step is not None:
                    position = position + deed.step * moved[-1][..., None]
        state = state.replace(vehicles=state.vehicles.replace(position=position))
        for rule in rules:
            state = rule.moved(state, now.roles, running)
        return state, reduce(or_, moved)

    def _refill(self, state: WorldState, tank: Tensor) -> Tensor:
        """Fill the tanks of vehicles beside a lake or at the base."""
        if self.tank is None:
            return tank
        index, inside = neighbourhood(state)
        cover = Situation.at(state.cover, index.flatten(1)).view_as(index)
        by_lake = ((cover == int(Cover.LAKE)) & inside).any(dim=-1)
        at_base = (state.vehicles.position == state.vehicles.base[:, None]).all(dim=-1)
        return torch.where(by_lake | at_base, self.tank, tank)


def _grounded(now: Situation, rules: Sequence[MoveRule]) -> list[Tensor]:
    """Return which agents cannot move by each rule that keeps some where they are, bool [B, A] each."""
    found = (rule.grounded(now.state, now.roles) for rule in rules)
    return [each for each in found if each is not None]


def changed(state: WorldState, target: Tensor, deeds: list[tuple[Tensor, Mapping[str, Tensor | int]]]) -> WorldState:
    """Return worlds with what credited acts make of their targets, int64 [B, A].

    It is written as sums of differences, so that the order of the agents does not matter.

    Args:
        state: The worlds before.
        target: Flat index of the cell of each agent's act.
        deeds: Of each ability the agents whose act is credited, bool [B, A], and what planes hold there afterwards.
    """
    planes = {name: getattr(state, name) for _, becomes in deeds for name in becomes}
    after = {}
    for name, plane in planes.items():
        codes = plane.view(torch.uint8).flatten(1)
        old = codes.gather(1, target)
        changes = [credited * (becomes[name] - old) for credited, becomes in deeds if name in becomes]
        after[name] = scatter_add(codes, target, reduce(add, changes)).view_as(plane).view(plane.dtype)
    return state.replace(**after)


def is_second(target: Tensor, acting: Tensor) -> Tensor:
    """Return which agents act on a target that an acting agent of lower index has, bool [B, A]."""
    same = (target[:, :, None] == target[:, None, :]) & acting[:, :, None] & acting[:, None, :]
    return same.tril(diagonal=-1).any(dim=-1)
