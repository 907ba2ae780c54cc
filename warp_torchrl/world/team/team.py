"""The vehicles: where they start, and how a step makes one of what each of them does."""

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property, partial, reduce
from operator import or_
from typing import Literal

import torch
from torch import Tensor

from warp_torchrl.validation import check_fields
from warp_torchrl.world.state.role import ROLES, RoleTable, role_names, role_table
from warp_torchrl.world.state.state import Action, ActionResult, Vehicles, WorldState
from warp_torchrl.world.team.abilities import ABILITIES, PAPER_ABILITIES, AgentContext
from warp_torchrl.world.team.acting import (
    AgentEffect,
    Attempts,
    TakeEffect,
    TeamAbility,
    TeamRule,
    changed,
    grounded_by,
    is_second,
)
from warp_torchrl.world.team.presence import staying
from warp_torchrl.world.team.start import starting_cells
from warp_torchrl.world.team.supply import filled

STAY = "stay"
"""Name of the action that does nothing."""


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
    def abilities(self) -> tuple[TeamAbility, ...]:
        """Return the abilities of the team, in the order of its actions."""
        names, codes = (*PAPER_ABILITIES, *self._further), self.action_names
        kinds = [ROLES[role] for role in self.roles]
        return tuple(
            TeamAbility(name, made, codes.index(made.actions[0]), all(name in kind.abilities for kind in kinds))
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
        return tuple(self.agent_roles), self.role_names, tuple(each.name for each in self.abilities)

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

    def open_moves(self, state: WorldState, rules: Sequence[TeamRule] = ()) -> Tensor:
        """Return which of the eight moves each agent can make under some rules, bool [B, A, 8]."""
        return self.abilities[0].mask(self._context(state, 0), rules)

    def action_mask(self, state: WorldState, last_spreading: int, rules: Sequence[TeamRule] = ()) -> Tensor:
        """Return which actions would do something, bool [B, A, actions].

        Stay is always open. Without it, an agent that can do nothing at all is shown ``EXTINGUISH``, which then does
        nothing: a policy needs one action to choose.

        Args:
            state: The worlds.
            last_spreading: Cell code of the last stage that can be put out.
            rules: What binds the vehicles.
        """
        now = self._context(state, last_spreading)
        can = [each.mask(now, rules) for each in self.abilities]
        if self.allow_stay:
            can.insert(len(PAPER_ABILITIES), torch.ones_like(can[-1][..., :1]))
        open_actions = torch.cat(can, dim=-1)
        if not self.allow_stay:
            open_actions[..., Action.EXTINGUISH] |= ~open_actions.any(dim=-1)
        for rule in rules:
            open_actions = rule.masked(state, open_actions)
        return open_actions

    def act(
        self,
        state: WorldState,
        action: Tensor,
        running: Tensor,
        last_spreading: int,
        wet_ticks: int,
        rules: Sequence[TeamRule] = (),
    ) -> tuple[WorldState, ActionResult]:
        """Let the agents move, then let them put out fire, clear trees, and do what else their roles can.

        Two agents at one target: it is done once, credited to the lower index; the other's act counts as redundant.

        Args:
            state: The worlds before the step.
            action: int64 [B, A].
            running: Which worlds go on, bool [B]; elsewhere nothing happens.
            last_spreading: Cell code of the last stage that can be put out.
            wet_ticks: Ticks for which a tree that was put out stays wet.
            rules: What binds the vehicles; the last of them stands around the acts of the others.

        Returns:
            The worlds after it, and what each action came to.
        """
        action = staying(state, action)
        origin = state.vehicles.position
        state, moved = self._move(state, action, running, rules)
        now, running = self._context(state, last_spreading, wet_ticks), running[:, None]
        target, water, chosen, effects = now.own_cell, torch.zeros_like(moved), [], []
        for each in self.abilities:
            if each.ability.moves:
                continue
            wanted = each.is_chosen(action) & running
            possible, effect = each.act(now, action)
            done = wanted & possible
            if effect.target is not None:
                target = torch.where(done, effect.target, target)
            if effect.takes_water is not None:
                water = water | (wanted & effect.takes_water & (state.vehicles.tank > 0))
            chosen.append(wanted)
            effects.append((done, effect.becomes))
        acts = reduce(or_, [done for done, _ in effects])
        attempts = Attempts(action, running, origin, moved, acts, target, water, torch.zeros_like(acts))
        take_effect: TakeEffect = partial(self._take_effect, chosen=reduce(or_, chosen), effects=effects)
        for rule in rules:
            take_effect = partial(rule.around, take_effect=take_effect)
        return take_effect(state, attempts)

    def _take_effect(
        self, state: WorldState, attempts: Attempts, *, chosen: Tensor, effects: Sequence[AgentEffect]
    ) -> tuple[WorldState, ActionResult]:
        """Return the worlds after attempts have taken effect, and what each action came to.

        Args:
            state: The worlds after the moves.
            attempts: Of the agents, but for what rules hold back.
            chosen: Which agents chose to act, bool [B, A].
            effects: Of each ability which agents would have an effect, bool [B, A], and what planes hold afterwards.
        """
        action, target, vehicles = attempts.action, attempts.target, state.vehicles
        redundant = is_second(target, attempts.acts)
        credited = attempts.acts & ~redundant
        after = changed(state, target, [(done & credited, becomes) for done, becomes in effects])
        tank = vehicles.tank - attempts.takes_water.to(torch.int32)
        after = after.replace(
            vehicles=vehicles.replace(
                tank=tank if self.tank is None else filled(state, tank, self.tank),
                last_action=torch.where(attempts.running, action, vehicles.last_action),
                acts=vehicles.acts + chosen,
                redundant=vehicles.redundant + redundant,
                last_useful=torch.where(credited | attempts.is_useful, state.step[:, None], vehicles.last_useful),
            )
        )
        result = ActionResult(
            action=action, moved=attempts.moved, credited=credited, redundant=redundant, target=target
        )
        return after, result

    def _context(self, state: WorldState, last_spreading: int, wet_ticks: int = 0) -> AgentContext:
        return AgentContext(state, self.table(state.cells.device), self.extinguish_p, last_spreading, wet_ticks)

    def _move(
        self, state: WorldState, action: Tensor, running: Tensor, rules: Sequence[TeamRule]
    ) -> tuple[WorldState, Tensor]:
        """Return the worlds after the moves, and which agents moved, bool [B, A]."""
        now, position, moved = self._context(state, 0), state.vehicles.position, []
        for each in self.abilities:
            if each.ability.moves:
                possible, effect = each.act(now, action)
                for grounded in grounded_by(rules, now):
                    possible = possible & ~grounded
                moved.append(each.is_chosen(action) & running[:, None] & possible)
                if effect.step is not None:
                    position = position + effect.step * moved[-1][..., None]
        state = state.replace(vehicles=state.vehicles.replace(position=position))
        for rule in rules:
            state = rule.moved(state, now.roles, running)
        return state, reduce(or_, moved)
