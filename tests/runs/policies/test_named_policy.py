"""A policy by the name that a command gives it."""

import pytest

from warp_torchrl.env.observation import Paper
from warp_torchrl.runs.config.construction import ConfigError
from warp_torchrl.runs.manifest import CheckpointError
from warp_torchrl.runs.policies.named_policy import NamedPolicy, fitted_policy


def test_a_word_that_names_no_policy_is_told_with_the_nearest():
    with pytest.raises(ConfigError, match=r"policy must be one of noop, .*, or a run folder, got gredy: did you mean"):
        NamedPolicy("gredy")


def test_a_folder_without_a_checkpoint_is_told(tmp_path):
    with pytest.raises(CheckpointError, match="no sound checkpoint"):
        NamedPolicy(str(tmp_path))


def test_a_shipped_policy_is_verified_and_a_baseline_has_no_checkpoint():
    assert NamedPolicy("skirmish").checkpoint.manifest.scenario == "skirmish"
    assert NamedPolicy("greedy").checkpoint is None


@pytest.mark.parametrize("key", ["model.no_such_key", "no_such_key", "algorithm.no_such_key"])
@pytest.mark.parametrize("name", ["skirmish", "greedy"])
def test_keys_that_it_does_not_read_are_checked_as_a_training_checks_them(name, key):
    with pytest.raises(ConfigError, match=f"{key} is not a key of"):
        NamedPolicy(name).config([f"+{key}=1"])
    with pytest.raises(ConfigError, match="debug must be true or false, got "):
        NamedPolicy(name).config(["+debug.x=1"])


def test_a_trained_policy_plays_in_the_scenario_of_its_training_unless_told(make_small_env):
    named = NamedPolicy("skirmish")
    assert named.config([])["scenario"] == "skirmish" and named.config(["scenario=large"])["scenario"] == "large"
    with pytest.raises(ConfigError, match="the policy skirmish does not fit here"):
        fitted_policy(named.checkpoint, make_small_env(observation=Paper()), "skirmish")
