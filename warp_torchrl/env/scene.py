"""One step of the worlds with its observations and rewards.

Compiled, it is one function of few cells, and two of many: one moves the agents, ticks the fire and makes the
forecast; the other observes.
"""

import logging
import math
from dataclasses import dataclass
from typing import NamedTuple

import torch
from torch import Tensor

from warp_torchrl.env.metrics import metrics
from warp_torchrl.env.observation import Observation, critic_state, searched_for
from warp_torchrl.env.reward import Collaborative, Efficiency, Reward, Time
from warp_torchrl.system.compiler import FEW_CELLS, check_compiler, compiled
from warp_torchrl.world.eager import why_eager
from warp_torchrl.world.state.cells import count_trees
from warp_torchrl.world.state.flags import in_bytes, in_flags
from warp_torchrl.world.state.state import ActionResult, Forecast, Transition, TreeCounts, WorldState
from warp_torchrl.world.world import World

_log = logging.getLogger("warp_torchrl")


class Observations(NamedTuple):
    """Observations, masks, metrics and central state of B worlds with A agents."""

    entries: dict[str, Tensor]
    """Of the agents' observation, [B, A, ...] each."""
    action_mask: Tensor
    """bool [B, A, actions]."""
    metrics: dict[str, Tensor]
    """float32 [B] each."""
    state: Tensor | None
    """The critic's, float32 [B, C, 16, 16]; None where nobody reads it."""
    radio: Tensor | None = None
    """Of ``Hearing.observed``, float32 [B, A, A, 3]; None where agents do not talk."""


class Step(NamedTuple):
    """A transition with its observations and rewards."""

    transition: Transition
    observations: Observations
    """Of the worlds after it."""
    reward: Tensor
    """float32 [B, A, 1]."""


@dataclass(frozen=True)
class Scene:
    """World, observation and reward as one step.

    Attributes:
        world: The scenario's rules.
        observation: What agents see.
        reward: What they earn.
        compile: Whether steps are compiled with ``torch.compile``.
    """

    world: World
    observation: Observation
    reward: Reward
    compile: bool = False

    def start(self, seeds: Tensor, episodes: Tensor) -> tuple[WorldState, TreeCounts, Observations, Tensor]:
        """Start episodes of seeds, int64 [n] each.

        Returns:
            The worlds, the counts of their trees, what is observed of them, and their faults: see ``World.start``.
        """
        state, faults = self.world.start(seeds, episodes)
        counts = count_trees(state)
        observed = self.observe(state, counts)
        state = self.world.hearing.with_shown(state, observed.entries, torch.ones_like(state.done))
        return state, counts, observed, faults

    def observe(self, state: WorldState, counts: TreeCounts) -> Observations:
        """Observe the worlds, given their counts of trees."""
        return _observe(self.world, self.observation, state, counts, self.world.forecast(state))

    def step(self, before: WorldState, counts: TreeCounts, action: Tensor, critic: bool = True) -> Step:
        """Step the worlds.

        Args:
            before: The worlds.
            counts: Of their trees.
            action: int64 [B, A].
            critic: Whether the central critic's state is observed.
        """
        if self.compile:
            return self._compiled_step(before, counts, action, critic)
        transition = self.world.step(before, action, counts)
        after, counts_after = transition.after, transition.counts_after
        observed = _observe(self.world, self.observation, after, counts_after, self.world.forecast(after), critic)
        after = self.world.hearing.with_shown(after, observed.entries, ~before.done)
        return Step(transition.replace(after=after), observed, self.reward(transition))

    def _compiled_step(self, before: WorldState, counts: TreeCounts, action: Tensor, critic: bool) -> Step:
        given, earns = in_bytes(before), self.reward if compiles(self.reward) else None
        in_two = before.cells.numel() > FEW_CELLS
        step = _step if in_two else compiled(_step, in_parts=True)
        after, result, counts_after, observed, reward = step(
            self.world, self.observation, earns, given, counts, action, critic, in_two
        )
        transition = Transition(
            before=before, result=result, after=in_flags(after), counts_before=counts, counts_after=counts_after
        )
        return Step(transition, observed, self.reward(transition) if reward is None else reward)


def why_not_compiled(world: World, observation: Observation, device: torch.device, n_worlds: int) -> str | None:
    """Return why a step is not compiled, and log it; None where it is.

    Raises:
        ValueError: If there is no C++ compiler to compile with.
    """
    check_compiler(device)
    why = why_eager(world.fire, device, n_worlds * math.prod(world.size))
    if (key := searched_for(observation)) is not None:
        why = f"a step with {key} is not compiled"
    why = next((each for mechanic in world.loop if (each := mechanic.why_eager()) is not None), why)
    if why is not None:
        _log.info("compile: %s", why)
    return why


def compiles(reward: Reward) -> bool:
    """Return whether a reward is compiled with the step: only built-in rewards that read counts and distances are.

    Rewards that loop over maps, and a user's own, are computed outside of the compiled functions.
    """
    reads_counts = type(reward) in (Efficiency, Time, Collaborative)
    return reads_counts and (reward.shaping == 0.0 or reward.potential == "distance")


def _step(
    world: World,
    observation: Observation,
    reward: Reward | None,
    state: WorldState,
    counts: TreeCounts,
    action: Tensor,
    critic: bool,
    in_two: bool,
) -> tuple[WorldState, ActionResult, TreeCounts, Observations, Tensor | None]:
    """Return the worlds after a step, its results, the counts of trees, the observations, and a reward if one is given.

    It is compiled as a whole, or calls two compiled functions.
    """
    advance, observe_and_earn = _advance, _observe_and_earn
    if in_two:
        advance, observe_and_earn = compiled(_advance), compiled(_observe_and_earn, in_parts=True)
    after, result, counts_after, forecast = advance(world, state, counts, action)
    transition = Transition(before=state, result=result, after=after, counts_before=counts, counts_after=counts_after)
    observed, earned = observe_and_earn(world, observation, reward, transition, forecast, critic)
    return after, result, counts_after, observed, earned


def _advance(
    world: World, state: WorldState, counts: TreeCounts, action: Tensor
) -> tuple[WorldState, ActionResult, TreeCounts, Forecast]:
    """Return the worlds after a step, the results of the actions, the counts of trees, and the forecast."""
    made = world.step(state, action, counts)
    return made.after, made.result, made.counts_after, world.forecast(made.after)


def _observe_and_earn(
    world: World,
    observation: Observation,
    reward: Reward | None,
    transition: Transition,
    forecast: Forecast,
    critic: bool,
) -> tuple[Observations, Tensor | None]:
    """Return the observations after a step, and its reward if one is given."""
    observed = _observe(world, observation, transition.after, transition.counts_after, forecast, critic)
    return observed, None if reward is None else reward(transition)


def _observe(
    world: World,
    observation: Observation,
    state: WorldState,
    counts: TreeCounts,
    forecast: Forecast,
    critic: bool = True,
) -> Observations:
    return Observations(
        observation(state, world, forecast),
        world.action_mask(state),
        metrics(state, counts, world),
        critic_state(observation, world)(state, forecast) if critic else None,
        world.hearing.observed(state, world.team.table(state.cells.device).flies)
        if world.hearing.sends_vectors
        else None,
    )
