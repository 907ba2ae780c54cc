"""The view as a PettingZoo ParallelEnv."""

import copy
import pickle
import re
import sys
from itertools import count
from types import SimpleNamespace

import numpy as np
import pettingzoo as zoo
import pytest
from gymnasium import spaces
from pettingzoo import ParallelEnv
from pettingzoo.test import api_test, max_cycles_test, parallel_api_test, parallel_seed_test, performance_benchmark

from warp_torchrl import make_env
from warp_torchrl.api.adapters import FireExtinguishingEnvParallel, parallel_env, pettingzoo

STAY = 10


def small(scenario="skirmish", **options):
    return parallel_env(scenario, **{"horizon": 3, **options})


def idle(env):
    return dict.fromkeys(env.agents, STAY)


@pytest.mark.filterwarnings("error::UserWarning")
@pytest.mark.parametrize("observation", ["surroundings", "paper"])
def test_pettingzoo_finds_its_interface_kept(observation):
    parallel_api_test(small(observation=observation), num_cycles=4)


@pytest.mark.filterwarnings("error::UserWarning")
def test_pettingzoo_finds_seeds_kept():
    parallel_seed_test(small, num_cycles=3)


def test_pettingzoo_finds_the_number_of_cycles_kept():
    max_cycles_test(pettingzoo)


@pytest.mark.filterwarnings("ignore:Observation")
def test_pettingzoo_finds_the_interface_of_taking_turns_kept():
    api_test(pettingzoo.env("skirmish", max_cycles=3), num_cycles=6)


def test_pettingzoo_measures_its_speed(monkeypatch, capsys):
    hurried = SimpleNamespace(time=count(step=0.5).__next__)  # its five seconds are over at once
    monkeypatch.setattr(sys.modules["pettingzoo.test.performance_benchmark"], "time", hurried)
    performance_benchmark(pettingzoo.env("skirmish", max_cycles=3))
    assert re.search(r"\n\d\.\d+ turns per second\n\d\.\d+ cycles per second\n", capsys.readouterr().out)


def test_it_is_the_paper_s_class_with_the_paper_s_names():
    env = small("hetero")
    assert isinstance(env, FireExtinguishingEnvParallel) and isinstance(env, ParallelEnv)
    assert {"bulldozer_0", "uav_0"} <= set(env.possible_agents) and env.max_num_agents == len(env.possible_agents)
    assert env.metadata["name"] == str(env) == "warp_torchrl_v0" and env.metadata["is_parallelizable"]


@pytest.mark.parametrize("observation", ["surroundings", "local", "paper"])
def test_the_flat_layout_is_one_vector_beside_the_mask(observation):
    named, flat = (small(observation=observation, layout=layout) for layout in ("dict", "flat"))
    (seen, infos), (vectors, others) = named.reset(seed=3), flat.reset(seed=3)
    for _ in range(3):
        one, vector, space = seen["bulldozer_1"], vectors["bulldozer_1"], flat.observation_space("bulldozer_1")
        mask = infos["bulldozer_1"]["action_mask"] if observation == "paper" else one["action_mask"]
        assert vector in space and list(vector) == ["observation", "action_mask"] and isinstance(space, spaces.Dict)
        assert vector["observation"].ndim == 1 and vector["observation"].dtype == np.float32
        assert (vector["action_mask"] == mask).all() and "action_mask" not in others["bulldozer_1"]
        if observation == "surroundings":
            bytes_as_shares = {name: one[name].ravel() / np.float32(255) for name in ("picture", "view")}
            joined = np.concatenate([bytes_as_shares["picture"], one["status"], bytes_as_shares["view"]])
            assert (vector["observation"] == joined).all() and space["observation"].high.max() == 3.0
        seen, _, _, _, infos = named.step(idle(named))
        vectors, _, _, _, others = flat.step(idle(flat))


@pytest.mark.filterwarnings("error::UserWarning")
@pytest.mark.parametrize("kind", ["parallel", "aec"])
def test_pettingzoo_makes_it_by_name(kind):
    if not hasattr(zoo, "make"):
        pytest.skip("this PettingZoo has no registry")
    env = zoo.make(kind, "Wildfire-v0", scenario="skirmish", max_cycles=3)
    assert isinstance(env, ParallelEnv if kind == "parallel" else zoo.AECEnv)
    env.reset(seed=0)
    assert zoo.spec(kind, "Wildfire").id == "Wildfire-v0"


@pytest.mark.parametrize("observation", ["surroundings", "local", "paper"])
def test_observations_state_and_infos_are_as_their_spaces_say(observation):
    env = small(observation=observation)
    seen, infos = env.reset()
    for _ in range(3):
        assert set(seen) == set(infos) == set(env.possible_agents)
        assert all(seen[name] in env.observation_space(name) for name in seen)
        assert env.state() in env.state_space and env.state().shape == (8, 16, 16)
        seen, rewards, _, _, infos = env.step(idle(env))
    assert all(type(reward) is float for reward in rewards.values())
    info = infos["bulldozer_0"]
    mask = info.pop("action_mask") if observation == "paper" else seen["bulldozer_0"]["action_mask"]
    assert mask.shape == (11,) and mask.dtype == np.int8 and mask[STAY] == 1
    assert all(isinstance(value, float) for value in info.values()) and 0.0 <= info["saved"] <= 1.0


def test_overrides_come_as_texts_or_by_name():
    env = small(overrides=["team.n_agents=3"], **{"team.roles": ["ugv", "uav"], "team.allow_stay": False})
    assert env.possible_agents == ["bulldozer_0", "uav_0", "bulldozer_1"] and env.action_space("uav_0").n == 10


def test_a_seed_starts_at_episode_0_and_no_seed_goes_on():
    env = small(seed=4)
    first, second = [env.reset()[0]["bulldozer_1"]["view"] for _ in range(2)]
    again, next_one = [env.reset(seed=seed)[0]["bulldozer_1"]["view"] for seed in (4, None)]
    assert (first == again).all() and (second == next_one).all() and (first != second).any()


COPIES = {
    "again": lambda env: small(),
    "deepcopy": copy.deepcopy,
    "pickle": lambda env: pickle.loads(pickle.dumps(env)),
    "cloudpickle": lambda env: pickle.loads(pytest.importorskip("cloudpickle").dumps(env)),
}


@pytest.mark.parametrize("way", COPIES)
def test_without_a_seed_copies_differ(way):
    one = small()
    other = COPIES[way](one)
    one.reset(), other.reset()
    assert (one.state() != other.state()).any()
    one.reset(seed=3), other.reset(seed=3)
    assert (one.state() == other.state()).all()


def test_a_given_seed_is_the_documented_world():
    env, theirs = small(seed=5), make_env("skirmish", n_worlds=1, seed=5)
    env.reset()
    assert (env.state() == theirs.reset()["state"][0].numpy()).all()


def test_numpy_s_generator_follows_the_seed():
    env, other = small(), small()
    env.reset(seed=3), other.reset(seed=3)
    assert env.np_random.integers(2**60) == other.np_random.integers(2**60)
    assert small().np_random.integers(2**60) != small().np_random.integers(2**60)


def test_it_can_be_sent_to_another_process():
    env = small(seed=2)
    other = pickle.loads(pickle.dumps(env))
    env.reset(), other.reset()
    assert (env.state() == other.state()).all()


def test_the_team_ends_together_and_is_then_empty():
    env = small()
    env.reset()
    for _ in range(3):
        seen, _, terminated, truncated, infos = env.step(idle(env))
    assert env.agents == [] and all(truncated.values()) and not any(terminated.values())
    assert set(seen) == set(infos) == set(env.possible_agents)
    env.reset()
    assert env.agents == env.possible_agents


@pytest.mark.parametrize(
    ("actions", "message"),
    [
        ({"bulldozer_0": 11, "bulldozer_1": 0}, r"action of bulldozer_0 must be in 0\.\.10, got 11"),
        ({"bulldozer_0": 0, "bulldozer_1": -1}, r"action of bulldozer_1 must be in 0\.\.10, got -1"),
        ({"bulldozer_0": 1.0, "bulldozer_1": 0}, r"action of bulldozer_0 must be a whole number, got 1\.0 \(float\)"),
        ({"bulldozer_0": True, "bulldozer_1": 0}, "must be a whole number, got True"),
        ({"bulldozer_0": None, "bulldozer_1": 0}, "must be a whole number, got None"),
        ({"bulldozer_0": np.zeros(2, int), "bulldozer_1": 0}, "must be a whole number"),
        ({"bulldozer_0": 0}, r"one of each of \['bulldozer_0', 'bulldozer_1'\], got \['bulldozer_0'\]"),
        ({"bulldozer_0": 0, "bulldozer_1": 0, "uav_0": 0}, r"got \['bulldozer_0', 'bulldozer_1', 'uav_0'\]"),
        ([0, 0], "actions must be a dict .* got list"),
    ],
)
def test_bad_actions_are_refused_in_one_line_and_change_nothing(skirmish, actions, message):
    before = skirmish.state()
    with pytest.raises(ValueError, match=message) as error:
        skirmish.step(actions)
    assert "\n" not in str(error.value) and (skirmish.state() == before).all()


@pytest.fixture(scope="module")
def skirmish():
    env = small()
    env.reset()
    return env


def test_whole_numbers_of_numpy_are_actions(skirmish):
    skirmish.step({"bulldozer_0": np.int32(STAY), "bulldozer_1": np.array(STAY)})
    skirmish.step({"bulldozer_0": np.array([STAY]), "bulldozer_1": np.array([STAY], np.int8)})


def test_stepping_a_finished_world_or_one_never_started_is_refused():
    env = small(max_cycles=1)
    for ask in (lambda: env.step({}), env.state):
        with pytest.raises(RuntimeError, match=r"call reset\(\) first"):
            ask()
    env.reset()
    env.step(idle(env))
    with pytest.raises(RuntimeError, match="the episode has ended"):
        env.step(dict.fromkeys(env.possible_agents, STAY))


@pytest.mark.parametrize(
    ("options", "message"),
    [
        ({"scenario": "nowhere"}, "nowhere"),
        ({"horizons": 5}, "horizons"),
        ({"seed": 1.5}, "seed must be a whole number, got 1.5"),
        ({"seed": -1}, "seed must be in"),
        ({"render_mode": "ansi"}, "render_mode must be None or human or rgb_array, got 'ansi'"),
        ({"layout": "list"}, "layout must be dict or flat, got 'list'"),
        ({"team": object()}, "team must be a text, a number or a list, got object"),
        ({"team": {"n_agents": 3}}, "team must be a text, a number or a list, got dict"),
    ],
)
def test_bad_options_are_refused_in_one_line(options, message):
    with pytest.raises(ValueError, match=message) as error:
        small(**options)
    assert "\n" not in str(error.value)


@pytest.mark.parametrize("seed", [-1, 2**62, "7", 0.0])
def test_bad_seeds_are_refused_and_change_nothing(skirmish, seed):
    before = skirmish.state()
    with pytest.raises(ValueError, match="seed must be"):
        skirmish.reset(seed=seed)
    assert (skirmish.state() == before).all()
