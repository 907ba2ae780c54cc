"""Groups of agents in TorchRL's sense, without agencies."""

import pytest
from torchrl.envs import check_env_specs

from warp_torchrl import make_env
from warp_torchrl.env import GroupedEnv
from warp_torchrl.env.groups import Groups


def test_groups_must_part_the_agents_in_their_order():
    for groups in ({"a": [0, 2], "b": [1]}, {"a": [0], "b": [0, 1]}, {"a": [0], "b": []}):
        with pytest.raises(ValueError, match="groups must part the agents in their order"):
            Groups(groups)


def test_an_environment_of_one_agency_has_one_group():
    env = GroupedEnv(make_env("skirmish", n_worlds=2))
    assert env.group_map == {"agents": ["bulldozer_0", "bulldozer_1"]}
    check_env_specs(env)
