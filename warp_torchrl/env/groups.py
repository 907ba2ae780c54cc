"""The agencies of a world as groups of agents, as TorchRL has them."""

import torch
from tensordict import TensorDictBase
from torchrl.data import Composite, TensorSpec
from torchrl.envs import Transform, TransformedEnv

from warp_torchrl.env.wildfire import WildfireEnv

_TEAM = "agents"


class Groups(Transform):
    """Parts the team's entries among groups: ``("agency_0", "observation", ...)``, ``("agency_0", "action")``.

    Args:
        groups: The agents of each group by their index, in order; each agent is in one.

    Raises:
        ValueError: If an agent is in no group or in two, or those of a group do not follow one another.
    """

    def __init__(self, groups: dict[str, list[int]]) -> None:
        super().__init__()
        members = [index for group in groups.values() for index in group]
        if members != list(range(len(members))) or not all(groups.values()):
            raise ValueError(f"groups must part the agents in their order, got {groups}")
        self.groups = {name: slice(group[0], group[-1] + 1) for name, group in groups.items()}

    def _call(self, next_tensordict: TensorDictBase) -> TensorDictBase:
        """Part what the team sees and earns."""
        team = next_tensordict.get(_TEAM, None)
        if team is None:
            return next_tensordict
        next_tensordict.exclude(_TEAM, inplace=True)
        for name, group in self.groups.items():
            next_tensordict.set(name, team[..., group])
        return next_tensordict

    def forward(self, tensordict: TensorDictBase) -> TensorDictBase:
        """Part what the team sees and earns, in data that was collected."""
        return self._call(tensordict)

    def _reset(self, tensordict: TensorDictBase, tensordict_reset: TensorDictBase) -> TensorDictBase:
        """Part what the team sees when it begins."""
        return self._call(tensordict_reset)

    def _inv_call(self, tensordict: TensorDictBase) -> TensorDictBase:
        """Join the actions of the groups."""
        actions = [tensordict.get((name, "action"), None) for name in self.groups]
        if any(action is None for action in actions):
            return tensordict
        return tensordict.set((_TEAM, "action"), torch.cat(actions, dim=-1))

    def transform_observation_spec(self, observation_spec: Composite) -> Composite:
        """Return the specs of what groups see."""
        return self._parted(observation_spec)

    def transform_reward_spec(self, reward_spec: Composite) -> Composite:
        """Return the specs of what groups earn."""
        return self._parted(reward_spec)

    def transform_action_spec(self, action_spec: Composite) -> Composite:
        """Return the specs of what groups do."""
        return self._parted(action_spec)

    def _parted(self, spec: Composite) -> Composite:
        if _TEAM not in spec.keys():
            return spec
        parts = {name: each.clone() for name, each in spec.items() if name != _TEAM}
        parts |= {name: _members(spec[_TEAM], group, spec.ndim) for name, group in self.groups.items()}
        return Composite(parts, shape=spec.shape, device=spec.device)


def _members(spec: TensorSpec, group: slice, dim: int) -> TensorSpec:
    """Return the spec of some members of a team."""
    if isinstance(spec, Composite):
        shape = (*spec.shape[:dim], group.stop - group.start)
        parts = {name: _members(each, group, dim) for name, each in spec.items()}
        return Composite(parts, shape=shape, device=spec.device)
    return spec[(slice(None),) * dim + (group,)]


class GroupedEnv(TransformedEnv):
    """An environment whose agencies are groups of agents in TorchRL's sense, each with keys of its own.

    Vehicles of the pool are a group too, ``pool``; whom they serve is their ``("pool", "agency")``.

    Args:
        env: Of a world with or without agencies; without there is one group, ``agents``.
    """

    def __init__(self, env: WildfireEnv) -> None:
        groups = env.world.agencies.groups(env.world.team)
        super().__init__(env, Groups(groups))
        self.group_map = {name: [env.agent_names[index] for index in group] for name, group in groups.items()}
        """Names of the agents of each group."""
