"""The world: assembles landscape, wind, fire and team, and is the only one that draws for them."""

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import TypeVar

import torch
from torch import Tensor

from warp_torchrl.world.arrays.batch import concatenated
from warp_torchrl.world.arrays.random import world_key
from warp_torchrl.world.backends import backend
from warp_torchrl.world.backends.tick import advance, initial_state
from warp_torchrl.world.mechanics.mechanic import Mechanic
from warp_torchrl.world.parts import Parts
from warp_torchrl.world.state.cells import count_trees, is_burning
from warp_torchrl.world.state.state import EMBER, FIRST_FIRE, Cover, Forecast, Transition, TreeCounts, WorldState

Answer = TypeVar("Answer")

_CELLS_AT_ONCE = {"cpu": 2**17, "cuda": 2**20}
"""Whose ground is made together: it takes some hundred bytes a cell while it is made, on a CPU best of its cache."""


@dataclass(frozen=True, kw_only=True)
class World(Parts):
    """The rules of a scenario. It holds no state: ``reset`` makes one, ``step`` makes the next.

    Its attributes are its parts (``parts.Parts``), with the errors that they raise.
    """

    def reset(self, seed: Tensor, episode: Tensor) -> WorldState:
        """Start an episode in each world: the ground, the fire after its head start, the team.

        Args:
            seed: int64 [B].
            episode: int64 [B], 0 for a seed's first.

        Returns:
            The worlds, batch size [B].

        Raises:
            ValueError: If a landscape has no tree that can burn, or too little dry ground for the team.
        """
        state, faults = self.start(seed, episode)
        self.check(faults.tolist())
        return state

    def start(self, seed: Tensor, episode: Tensor) -> tuple[WorldState, Tensor]:
        """Start an episode in each world, as ``reset`` does, and tell what is wrong with them in place of raising.

        Args:
            seed: int64 [B].
            episode: int64 [B], 0 for a seed's first.

        Returns:
            The worlds, and whether any has no tree that can burn, or too little dry ground for the team, bool [2]:
            what ``check`` takes, once it has been read.
        """
        at_once = max(1, _CELLS_AT_ONCE["cuda" if seed.is_cuda else "cpu"] // math.prod(self.size))
        parts = [self._start(*part) for part in zip(seed.split(at_once), episode.split(at_once), strict=True)]
        states, faults = zip(*parts, strict=True)
        return states[0] if len(parts) == 1 else concatenated(list(states)), torch.stack(faults).any(dim=0)

    def check(self, faults: Sequence[bool]) -> None:
        """Check the faults that ``start`` found.

        Raises:
            ValueError: If a landscape has no tree that can burn, or too little dry ground for the team.
        """
        is_dark, is_crowded = faults
        if is_dark:
            raise ValueError(self.lighting.why_dark)
        if is_crowded:
            raise ValueError(f"team.n_agents must fit on a map's dry ground, got {self.team.n_agents}")

    def _start(self, seed: Tensor, episode: Tensor) -> tuple[WorldState, Tensor]:
        key = world_key(seed, episode)
        ground = self.air.shaped(self.fire.aged(self.landscape(key), key), self.side_of_cell)
        fuel = (ground.age >= self.fire.youngest_fuel) & (self.fire.flammability(ground) > 0.0)
        lit = self.lighting(key, fuel)
        vehicles = self.team.place(key, ground.cover, lit)
        is_dark = ~lit.flatten(1).any(dim=1).all()
        state = initial_state(
            ground,
            self.fire,
            self.air.on(key, ground),
            key,
            vehicles,
            self.side_of_cell,
            self.air.moisture(key, torch.zeros_like(key)),
        )
        cells = state.cells
        state = state.replace(cells=torch.where(lit, FIRST_FIRE, cells), age=torch.where(lit, cells, state.age))
        state = self.fire.started(state)
        for _ in range(self.ignition.head_start):
            spreads = (state.cells >= FIRST_FIRE) & (state.cells < EMBER)
            state = self._tick(state, spreads.flatten(1).any(dim=1))
        for each in self.loop:
            state = each.begin(state, self)
        index = state.vehicles.position[..., 0] * self.size[1] + state.vehicles.position[..., 1]
        is_crowded = (ground.cover.flatten(1).gather(1, index) == int(Cover.LAKE)).any()
        return state, torch.stack((is_dark, is_crowded))

    def step(self, state: WorldState, action: Tensor, counts: TreeCounts | None = None) -> Transition:
        """Advance every world that has not ended by one agent step.

        Agents move; agents act; on every ``steps_per_tick``-th step the fire ticks, and its embers fall; the clock
        advances; mechanics step, in the order of ``loop``: vehicles are lent, packets set out, agents look and are
        told.

        Args:
            state: The worlds, batch size [B].
            action: int64 [B, A], ``Action`` codes.
            counts: ``count_trees(state)``, where it is known; None counts.

        Returns:
            The transition; ``before`` is ``state`` itself.
        """
        running = ~state.done
        after, result = self.team.act(state, action, running, self.fire.last_spreading, self.fire.wet_for, self.loop)
        ticks_now = running & ((state.step + 1) % self.steps_per_tick == 0)
        after = self._tick(after, ticks_now)
        for each in self.igniting:
            after = each.after_tick(after, ticks_now, self)
        counts_after = count_trees(after)
        after = self._advance_clock(after, counts_after, running)
        for each in self.loop:
            after = each.step(state, after, running, self)
        return Transition(
            before=state,
            result=result,
            after=after,
            counts_before=count_trees(state) if counts is None else counts,
            counts_after=counts_after,
        )

    def restored(self, state: WorldState) -> WorldState:
        """Return worlds with what follows from their landscape and wind made anew."""
        ground = self.fire.ground(state.landscape, self.side_of_cell, state.key)
        return state.replace(ground=ground, air=backend.air(self.fire, state.wind, state.air.moisture, ground))

    def assumed(self, state: WorldState) -> WorldState:
        """Return the worlds as agents assume them to be, see ``Mechanic.assumed``; where they see all, these."""
        return self._last(lambda each: each.assumed(state, self)) or state

    def worth_seeing(self, state: WorldState) -> Tensor:
        """Return what agents would learn of each cell if they saw it now, see ``Mechanic.worth_seeing``; else 0."""
        known = self._last(lambda each: each.worth_seeing(state, self))
        return torch.zeros_like(state.alpha)[:, None] if known is None else known

    def believed_fire(self, state: WorldState) -> tuple[Tensor, Tensor]:
        """Return how likely agents think each cell to burn, see ``Mechanic.believed_fire``; else what they assume."""
        believed = self._last(lambda each: each.believed_fire(state, self))
        if believed is not None:
            return believed
        burns = is_burning(self.assumed(state).cells).unflatten(0, (len(state.key), -1)).to(torch.float32)
        return burns, torch.zeros_like(burns)

    def buildings(self, state: WorldState) -> Tensor | None:
        """Return what is left of the buildings in each cell, see ``Mechanic.buildings``; None where there are none."""
        return self._last(lambda each: each.buildings(state))

    def futures(self, state: WorldState, count: int) -> WorldState:
        """Return worlds that may be the true ones, see ``Mechanic.futures``; where nobody knows better, these."""
        rows = torch.arange(len(state.key), device=state.key.device).repeat_interleave(count)
        return self._last(lambda each: each.futures(state, self, count)) or state[rows]

    def forecast(self, state: WorldState) -> Forecast:
        """Return what the fire is about to do."""
        return backend.forecast(self.fire, state)

    def possible_actions(self, state: WorldState) -> Tensor:
        """Return which actions would do something, bool [B, A, actions]."""
        return self.team.action_mask(state, self.fire.last_spreading, self.loop)

    def open_moves(self, state: WorldState) -> Tensor:
        """Return which of the eight moves each agent can make, bool [B, A, 8]."""
        return self.team.open_moves(state, self.loop)

    def action_mask(self, state: WorldState) -> Tensor:
        """Return which actions agents are shown as open, bool [B, A, actions]: those possible, or all."""
        possible = self.possible_actions(state)
        return possible if self.action_masking else torch.ones_like(possible)

    def _last(self, ask: Callable[[Mechanic], Answer | None]) -> Answer | None:
        """Return the answer of the last mechanic that gives one; those before it are not asked."""
        answers = (ask(each) for each in reversed(self.loop))
        return next((each for each in answers if each is not None), None)

    def _tick(self, state: WorldState, ticks_now: Tensor) -> WorldState:
        if self.steps_per_tick == 1:
            return advance(state, self.fire, self.air, ticks_now)
        return backend.advance_rows(state, ticks_now, lambda rows, ticks: advance(rows, self.fire, self.air, ticks))

    def _advance_clock(self, state: WorldState, counts: TreeCounts, running: Tensor) -> WorldState:
        step = state.step + running
        terminated = (counts.alight == 0) & self.fire.burns_out
        for each in self.igniting:
            smoulders = each.smoulders(state)
            terminated = terminated if smoulders is None else terminated & ~smoulders
        share_burning = counts.burning / counts.initial
        return state.replace(
            step=step,
            burning_area=state.burning_area + share_burning * running,
            terminated=state.terminated | terminated,
            truncated=state.truncated | (step >= self.horizon),
        )
