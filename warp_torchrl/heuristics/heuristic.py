"""The base class of heuristics."""

from typing import ClassVar, Protocol

import torch
from tensordict import TensorDictBase
from tensordict.nn import TensorDictModuleBase
from torch import Tensor

from warp_torchrl.heuristics.base import idle_action
from warp_torchrl.heuristics.seeking import by_own_view, can_act_on_fire, seek
from warp_torchrl.system.modes import apart
from warp_torchrl.world.state.cells import is_burning
from warp_torchrl.world.state.state import WorldState
from warp_torchrl.world.team.presence import staying
from warp_torchrl.world.world import World


class Worlds(Protocol):
    """The part of an environment that a heuristic reads."""

    @property
    def world(self) -> World:
        """Return the rules."""

    @property
    def shared_state(self) -> WorldState:
        """Return the present state of the worlds; it must not be changed."""


class Heuristic(TensorDictModuleBase):
    """A heuristic policy for one environment.

    Args:
        env: The environment whose rules and worlds it reads.
    """

    in_keys = [("agents", "action_mask")]  # noqa: RUF012
    out_keys = [("agents", "action")]  # noqa: RUF012
    is_stateful: ClassVar[bool] = False
    """Whether its actions depend on more than the current state."""
    reads_map: ClassVar[bool] = True
    """Whether it reads the fire of a whole map; where sight is limited, on the map that its agents assume."""

    def __init__(self, env: Worlds) -> None:
        super().__init__()
        self._env = (env,)  # in a tuple, so that the environment does not become a submodule
        self.sees_all = False
        """Whether it acts on the true worlds where its agents' sight is limited, as teachers do."""

    @property
    def env(self) -> Worlds:
        """Return the environment."""
        return self._env[0]

    @property
    def world(self) -> World:
        """Return the environment's rules."""
        return self.env.world

    @apart
    def forward(self, tensordict: TensorDictBase) -> TensorDictBase:
        """Write the team's actions, int64 [B, A]."""
        state, world = self.env.shared_state, self.world
        shown = tensordict.get(("agents", "action_mask"))
        action = self.act(state, shown if world.action_masking else world.possible_actions(state))
        return tensordict.set(("agents", "action"), staying(state, action))

    def act(self, state: WorldState, mask: Tensor) -> Tensor:
        """Return the actions, int64 [B, A], as far as agents know the worlds.

        Where sight is limited, a heuristic that reads the fire of a whole map chooses on the map that its agents assume
        (``World.assumed``): on the team's, or each agent on its own. Agents that know of no fire, cannot act on it, or
        are left idle search (``seeking.seek``).
        """
        world = self.world
        if self.sees_all or not (self.reads_map and world.sensing.is_limited):
            return self.choose(state, mask)
        assumed, agents = world.assumed(state), mask.shape[1]
        views = len(assumed.key) // len(mask)
        own = by_own_view(self.choose(assumed, mask.repeat_interleave(views, dim=0)), views)
        knows = is_burning(assumed.cells).flatten(1).any(dim=1).view(-1, views).expand(-1, agents)
        acts = knows & (own != idle_action(mask, world.team)) & can_act_on_fire(world, mask.device)
        return torch.where(acts, own, seek(state, assumed, world, mask))

    def choose(self, state: WorldState, mask: Tensor) -> Tensor:
        """Return the actions, int64 [B, A], for worlds and the actions that do something, bool [B, A, actions]."""
        raise TypeError(f"{type(self).__name__} does not say what to do: define choose()")


def instructor(kind: type[Heuristic], env: Worlds, privileged: bool = True) -> Heuristic:
    """Return a heuristic that teaches or guides: if privileged it sees the true worlds, else it acts as in play."""
    made = kind(env)
    made.sees_all = privileged
    return made
