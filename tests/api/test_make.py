"""What users call by name: environments and policies."""

import numpy as np
import pytest
import torch

from tests.world.mechanics.there import needs
from warp_torchrl import Array, WildfireEnv, baselines, load_policy, make_env, scenarios
from warp_torchrl.runs.checkpoint import CheckpointError
from warp_torchrl.runs.config.construction import ConfigError
from warp_torchrl.world.air.wind import Calm, Uniform


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


def test_keywords_are_options_values_and_components():
    env = make_env(
        "default",
        n_worlds=2,
        overrides=["horizon=40", "steps_per_tick=2"],
        horizon=7,
        fire="paper",
        team=dict(n_agents=3, roles=["uav", "ugv"]),
        wind=Uniform(speed=np.float64(3)),
    )
    world = env.world
    assert (world.horizon, world.steps_per_tick, world.fire.beta, env.n_agents) == (7, 2, 0.65, 3)
    assert world.team.roles == ("uav", "ugv") and world.wind == Uniform(speed=3.0)


@needs("flight")
def test_a_mechanic_is_given_by_its_keys():
    world = make_env("skirmish", mechanics=dict(flight=dict(separation=2.0))).world
    assert [each.separation for each in world.mechanics if each.name == "flight"] == [2.0]


COVER = np.full((20, 24), 2)


def test_an_array_of_another_size_than_the_scenario_s_is_never_cropped_in_silence(tmp_path):
    np.savez(tmp_path / "map.npz", cover=COVER)
    by_path = ["landscape=array", f"landscape.path={tmp_path / 'map.npz'}"]
    assert make_env("default", landscape=Array(cover=COVER), n_worlds=1).world.size == (20, 24)
    assert make_env("default", overrides=by_path, n_worlds=1).world.size == (20, 24)
    assert make_env("default", overrides=[*by_path, "landscape.size=10"], n_worlds=1).world.size == (10, 10)


@pytest.mark.parametrize(
    ("keywords", "told"),
    [
        (
            {"overrides": "fire=paper"},
            r"overrides must be a list of texts, \['fire=paper'\], got the text 'fire=paper'",
        ),
        ({"team": {"roles": "ugv"}}, "team.roles must be a list of a text, got 'ugv'"),
        ({"team": {"n_agent": 3}}, "team.n_agent is not a key of the configuration: did you mean team.n_agents?"),
        ({"n_world": 3}, "n_world is not a key of the configuration: did you mean n_worlds?"),
        ({"fire": "papre"}, "fire must be one of .*, got papre: did you mean paper?"),
        ({"landscape": {"path": COVER}}, r"landscape.path must be a plain value or a list.*landscape=Array\(...\)"),
        ({"wind": Array(cover=COVER)}, "wind must be Wind, got Array"),
        ({"reward": Calm()}, r"reward must be a component of reward, got Calm\(\)"),
        ({"horizon": Calm()}, "horizon must be no object; landscape, wind, "),
    ],
)
def test_a_keyword_that_does_not_fit_is_refused_in_a_line(keywords, told):
    with pytest.raises(ValueError, match=told) as error:
        make_env("default", **keywords)
    assert "\n" not in str(error.value)


def test_scenarios_and_baselines_have_a_sentence_each():
    assert scenarios()["skirmish"] == "Two bulldozers, two fires, 16 x 16."
    assert baselines()["noop"].startswith("Stays") and all(text.endswith(".") for text in baselines().values())
    assert all(text and "@package" not in text for text in {**scenarios(), **baselines()}.values())
