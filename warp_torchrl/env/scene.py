"""A step of the worlds, and what is observed and earned by it.

Compiled, it is two functions: one moves and acts, ticks the fire, counts and forecasts; the other observes what came.
"""

from dataclasses import dataclass
from typing import NamedTuple

from torch import Tensor

from warp_torchrl.env.metrics import metrics
from warp_torchrl.observation import Observation, central_state
from warp_torchrl.reward import Collaborative, Efficiency, Reward, Time
from warp_torchrl.world.fast.compile import compiled
from warp_torchrl.world.fast.road import in_bytes, in_flags
from warp_torchrl.world.state import ActionResult, Forecast, Transition, TreeCounts, WorldState
from warp_torchrl.world.world import World


class Observations(NamedTuple):
    """What is observed in worlds; of all of them B, of agents A."""

    entries: dict[str, Tensor]
    """Of the agents' observation, [B, A, ...] each."""
    action_mask: Tensor
    """bool [B, A, actions]."""
    metrics: dict[str, Tensor]
    """float32 [B] each."""
    state: Tensor
    """The critic's, float32 [B, C, 16, 16]."""


class Step(NamedTuple):
    """A step, and what came of it."""

    transition: Transition
    observations: Observations
    """Of the worlds after it."""
    reward: Tensor
    """float32 [B, A, 1]."""


@dataclass(frozen=True)
class Scene:
    """The rules of the worlds, and what is observed and earned in them.

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

    def observe(self, state: WorldState, counts: TreeCounts) -> Observations:
        """Return what is observed in worlds, with their counts of trees."""
        return _observe(self.world, self.observation, state, counts, self.world.forecast(state))

    def step(self, before: WorldState, counts: TreeCounts, action: Tensor) -> Step:
        """Return a step of the worlds, with their counts of trees and actions int64 [B, A]."""
        if self.compile:
            return self._compiled_step(before, counts, action)
        transition = self.world.step(before, action, counts)
        return Step(transition, self.observe(transition.after, transition.counts_after), self.reward(transition))

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


def compiles(reward: Reward) -> bool:
    """Return whether a reward is compiled with the step: one of ours that reads counts and distances, and no map.

    Those that loop over maps, and a user's own, are computed beside it.
    """
    reads_counts = type(reward) in (Efficiency, Time, Collaborative)
    return reads_counts and (reward.shaping == 0.0 or reward.potential == "distance")


def _advance(
    world: World, state: WorldState, counts: TreeCounts, action: Tensor
) -> tuple[WorldState, ActionResult, TreeCounts, Forecast]:
    """Return the worlds after a step, what the actions came to, the counts of trees, and the forecast."""
    made = world.step(state, action, counts)
    return made.after, made.result, made.counts_after, world.forecast(made.after)


def _observe_and_earn(
    world: World, observation: Observation, reward: Reward | None, transition: Transition, forecast: Forecast
) -> tuple[Observations, Tensor | None]:
    """Return what is observed after a step, and what it earns if there is a reward to ask."""
    observed = _observe(world, observation, transition.after, transition.counts_after, forecast)
    return observed, None if reward is None else reward(transition)


def _observe(
    world: World, observation: Observation, state: WorldState, counts: TreeCounts, forecast: Forecast
) -> Observations:
    return Observations(
        observation(state, world, forecast),
        world.action_mask(state),
        metrics(state, counts, world.horizon),
        central_state(state, world, forecast),
    )
