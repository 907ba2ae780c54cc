"""What users call by name: environments and policies."""

import pytest
import torch

from warp_torchrl import WildfireEnv, load_policy, make_env
from warp_torchrl.runs.checkpoint import CheckpointError
from warp_torchrl.runs.config.construction import ConfigError


def test_make_env_makes_a_scenario_with_overrides():
    env = make_env("default", n_worlds=3, seed=5, overrides=["team.n_agents=2", "fire=paper", "observation=local"])
    assert isinstance(env, WildfireEnv) and env.batch_size == (3,) and env.n_agents == 2
    assert env.world.fire.beta == 0.65 and env.state_dict()["seeds"].tolist() == [5, 6, 7]
    assert "picture" not in env.reset()["agents", "observation"].keys()


def test_make_env_takes_seeds_one_by_one():
    assert make_env("skirmish", seeds=[4, 400]).state_dict()["seeds"].tolist() == [4, 400]


def test_make_env_tells_mistakes():
    with pytest.raises(ConfigError, match="nowhere"):
        make_env("nowhere")
    with pytest.raises(ValueError, match=r"team\.n_agents must be in"):
        make_env("skirmish", overrides=["team.n_agents=0"])


def test_world_state_has_the_codes_of_the_contract():
    env = make_env("skirmish", n_worlds=2)
    env.reset()
    state = env.world_state
    assert state.cells.dtype == state.cover.dtype == torch.uint8
    assert state.cells.shape == state.cover.shape == (2, 16, 16)
    assert int(state.cells.max()) <= 15 and int(state.cover.max()) <= 4


def test_load_policy_tells_what_is_missing(tmp_path):
    with pytest.raises(CheckpointError, match="no sound checkpoint"):
        load_policy(tmp_path)


def test_a_key_that_no_file_has_is_refused():
    with pytest.raises(ValueError, match="no_such_key is not a key of the configuration; it has"):
        make_env("skirmish", overrides=["+no_such_key=1"])
