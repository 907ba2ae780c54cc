"""One step of the worlds with its observations and rewards.

Compiled, it is two functions: one moves the agents, ticks the fire and makes the forecast; the other observes.
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
from warp_torchrl.system.compiler import check_compiler, compiled
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
    state: Tensor
    """The critic's, float32 [B, C, 16, 16]."""
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

    def step(self, before: WorldState, counts: TreeCounts, action: Tensor) -> Step:
        """Step the worlds, given their counts of trees, with actions int64 [B, A]."""
        if self.compile:
            return self._compiled_step(before, counts, action)
        transition = self.world.step(before, action, counts)
        observed = self.observe(transition.after, transition.counts_after)
        after = self.world.hearing.with_shown(transition.after, observed.entries, ~before.done)
        return Step(transition.replace(after=after), observed, self.reward(transition))

    def _compiled_step(self, before: WorldState, counts: TreeCounts, action: Tensor) -> Step:
        given, earns = in_bytes(before), self.reward if compiles(self.reward) else None
        after, result, counts_after, forecast = compiled(_advance)(self.world, given, counts, action)
        transition = Transition(
            before=given, result=result, after=after, counts_before=counts, counts_after=counts_after
        )
        observed, reward = compiled(_observe_and_earn, in_parts=True)(
            self.world, self.observation, earns, transition, forecast
        )
        transition = transition.replace(before=before, after=in_flags(after))
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


def _advance(
    world: World, state: WorldState, counts: TreeCounts, action: Tensor
) -> tuple[WorldState, ActionResult, TreeCounts, Forecast]:
    """Return the worlds after a step, the results of the actions, the counts of trees, and the forecast."""
    made = world.step(state, action, counts)
    return made.after, made.result, made.counts_after, world.forecast(made.after)


def _observe_and_earn(
    world: World, observation: Observation, reward: Reward | None, transition: Transition, forecast: Forecast
) -> tuple[Observations, Tensor | None]:
    """Return the observations after a step, and its reward if one is given."""
    observed = _observe(world, observation, transition.after, transition.counts_after, forecast)
    return observed, None if reward is None else reward(transition)


def _observe(
    world: World, observation: Observation, state: WorldState, counts: TreeCounts, forecast: Forecast
) -> Observations:
    return Observations(
        observation(state, world, forecast),
        world.action_mask(state),
        metrics(state, counts, world),
        critic_state(observation, world)(state, forecast),
        world.hearing.observed(state, world.team.table(state.cells.device).flies)
        if world.hearing.sends_vectors
        else None,
    )
