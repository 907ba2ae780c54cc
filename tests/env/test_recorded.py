"""A recorded step is the step, and a GPU can record it: no size and no choice in it depends on a result."""

import sys

import pytest
import torch
from torch.fx.experimental.proxy_tensor import make_fx
from torch.nn import functional

from tests.world.mechanics import of_mechanics
from tests.world.mechanics.there import can_play
from warp_torchrl.env import WildfireEnv
from warp_torchrl.env.recorded import RecordedStep
from warp_torchrl.env.reward import Time
from warp_torchrl.runs.config.building import run_config
from warp_torchrl.runs.config.compose import compose_config, plain
from warp_torchrl.system.device import unread

BRIEFLY = [
    ["scenario=skirmish"],
    *of_mechanics("WORLDS").values(),
]
AT_LENGTH = [
    ["scenario=hazard", "reward=adaptive"],
    ["scenario=smoke", "mechanics.radio.carries=both", "mechanics.radio.delay=2", "mechanics.radio.loss=0.1"],
    ["scenario=lightning", "wind=wandering"],
    ["scenario=default", "observation=paper", "landscape.relief=200", "fire=paper"],
    ["scenario=hetero", "reward=collaborative"],
    ["scenario=smoke", "mechanics.radio.carries=both", "mechanics.radio.range=6", "mechanics.radio.loss=0.1"],
    ["scenario=front"],
]
SCENARIOS = [
    *filter(can_play, BRIEFLY),
    *(pytest.param(each, marks=pytest.mark.slow) for each in AT_LENGTH if can_play(each)),
]


def one_hot(codes, count):
    return (codes[..., None] == torch.arange(count)).long()


def env_of(overrides, **options):
    plan = run_config(plain(compose_config("train", [*overrides, "landscape.size=16", "horizon=20"])))
    return WildfireEnv(plan.world, observation=plan.observation, reward=plan.reward, n_worlds=3, seed=2, **options)


@pytest.mark.parametrize("overrides", SCENARIOS, ids=" ".join)
def test_recorded_worlds_are_those_of_steps(overrides):
    with unread():
        eager, recorded = env_of(overrides), env_of(overrides, graph=True)
        one, other = eager.reset(), recorded.reset()
        for _ in range(12):
            action = eager.rand_action(one)["agents", "action"]
            one, other = (
                env.step(shown.set(("agents", "action"), action))["next"]
                for env, shown in ((eager, one), (recorded, other))
            )
            assert (one == other).all()
    for name, leaf in eager.world_state.leaves().items():
        assert torch.equal(recorded.world_state.leaves()[name], leaf), name


@pytest.mark.parametrize("overrides", SCENARIOS, ids=" ".join)
def test_no_size_in_a_step_depends_on_a_result(overrides, monkeypatch):
    for module in [each for each in sys.modules.values() if vars(each).get("one_hot") is functional.one_hot]:
        monkeypatch.setattr(module, "one_hot", one_hot)  # torch's reads the codes on a CPU, to check them
    with unread():
        env = env_of(overrides)
        shown = env.rand_action(env.reset())
        env.step(shown)  # makes the constants
        step = RecordedStep(env._scene)
        step._like = env.world_state, env.tree_counts
        given = [*env.world_state.leaves().values(), *env.tree_counts.leaves().values(), shown["agents", "action"]]
        traced = make_fx(lambda *tensors: step._flat([*tensors]), tracing_mode="fake", _allow_non_fake_inputs=True)(
            *given
        )
    assert len(traced.graph.nodes) > 300


def test_a_recording_keeps_nothing_of_what_it_returned():
    with unread():
        env = env_of(["scenario=skirmish"], graph=True)
        shown = env.step(env.rand_action(env.reset()))["next"]
        kept, before = shown["agents", "observation"].clone(), shown["agents", "observation"]
        env.step(env.rand_action(shown))
        assert (kept == before).all()


def test_another_reward_is_recorded_anew():
    with unread():
        env = env_of(["scenario=skirmish"], graph=True)
        shown = env.step(env.rand_action(env.reset()))["next"]
        first, env.reward_function = env._recorded, Time()
        env.step(env.rand_action(shown))
    assert env._recorded is not first and env._recorded.scene.reward == Time()
