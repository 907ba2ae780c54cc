"""A step of the worlds, and what is seen and earned by it: what the environment plays.

Fused, it is two functions: one moves and acts, ticks the fire, counts and looks ahead; the other looks at what came.
"""

from dataclasses import dataclass
from typing import NamedTuple

from torch import Tensor

from warp_torchrl.metrics import metrics
from warp_torchrl.observation import Observation, central_state
from warp_torchrl.reward import Reward
from warp_torchrl.world.fusion import fused
from warp_torchrl.world.state import Outcome, Transition, WorldState, in_bytes, in_flags
from warp_torchrl.world.world import World


class Seen(NamedTuple):
    """What is seen of worlds; of all of them B, of agents A."""

    views: dict[str, Tensor]
    """Entries of the observation, [B, A, ...] each."""
    action_mask: Tensor
    """bool [B, A, actions]."""
    metrics: dict[str, Tensor]
    """float32 [B] each."""
    state: Tensor
    """The critic's, float32 [B, C, 16, 16]."""


class Played(NamedTuple):
    """A step, and what came of it."""

    transition: Transition
    seen: Seen
    """Of the worlds after it."""
    reward: Tensor
    """float32 [B, A, 1]."""


@dataclass(frozen=True)
class Scene:
    """The rules of the worlds, and how they are looked at.

    Attributes:
        world: The scenario's rules.
        observation: What agents see.
        reward: What they earn.
        fuse: Whether steps are fused with ``torch.compile``.
    """

    world: World
    observation: Observation
    reward: Reward
    fuse: bool = False

    def see(self, state: WorldState) -> Seen:
        """Return what is seen of worlds."""
        return _look(self.world, self.observation, self.world.with_outlook(state))

    def play(self, before: WorldState, action: Tensor) -> Played:
        """Return a step of the worlds, with actions int64 [B, A]."""
        if self.fuse:
            return self._play_fused(before, action)
        transition = self.world.step(before, action)
        return Played(transition, self.see(transition.after), self.reward(transition))

    def _play_fused(self, before: WorldState, action: Tensor) -> Played:
        given, earns = in_bytes(before), self.reward if self.reward.fuses else None
        after, outcome, outlook = fused(_step)(self.world, given, action)
        told = Transition(before=given, outcome=outcome, after=after)
        seen, reward = fused(_look_and_earn, in_parts=True)(self.world, self.observation, earns, told, outlook)
        transition = told.replace(before=before, after=in_flags(after))
        return Played(transition, seen, self.reward(transition) if reward is None else reward)


_Outlook = dict[str, Tensor | None]
"""What worlds keep for all who look."""


def _step(world: World, state: WorldState, action: Tensor) -> tuple[WorldState, Outcome, _Outlook]:
    """Return the worlds after a step, what the actions came to, and the outlook."""
    transition = world.step(state, action)
    seen = world.with_outlook(transition.after)
    return transition.after, transition.outcome, {"front": seen.front, "chance": seen.chance, "fuel": seen.fuel}


def _look_and_earn(
    world: World, observation: Observation, reward: Reward | None, transition: Transition, outlook: _Outlook
) -> tuple[Seen, Tensor | None]:
    """Return what is seen after a step, and what it earns if there is a reward to ask."""
    seen = _look(world, observation, transition.after.replace(**outlook))
    return seen, None if reward is None else reward(transition)


def _look(world: World, observation: Observation, state: WorldState) -> Seen:
    return Seen(
        observation(state, world),
        world.action_mask(state),
        metrics(state, world.horizon),
        central_state(state, world),
    )
