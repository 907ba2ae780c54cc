"""A recorded step is the step, and a GPU can record it: no size and no choice in it depends on a result."""

import sys

import pytest
import torch
from torch.nn import functional
from torch.utils._python_dispatch import TorchDispatchMode

from tests.env.scenarios import FURTHER, MECHANICS, OF_MECHANICS
from tests.world.mechanics.there import can_play
from warp_torchrl.env import WildfireEnv
from warp_torchrl.env.recorded import RecordedStep
from warp_torchrl.env.reward import Time
from warp_torchrl.runs.config.building import run_config
from warp_torchrl.runs.config.compose import compose_config
from warp_torchrl.runs.config.plain_values import plain
from warp_torchrl.system.device import unread

AT_LENGTH = [
    ["scenario=hazard", "reward=adaptive"],
    ["scenario=lightning", "wind=wandering"],
    ["scenario=default", "observation=paper", "landscape.relief=200", "fire=paper"],
    ["scenario=hetero", "reward=collaborative"],
    ["scenario=smoke", "mechanics.radio.carries=both", "mechanics.radio.range=6", "mechanics.radio.loss=0.1"],
    ["scenario=front"],
    *MECHANICS.values(),
]
BRIEFLY = [["scenario=skirmish"], *(FURTHER[name] for name in OF_MECHANICS if name in FURTHER)]
SCENARIOS = [
    *BRIEFLY,
    *(pytest.param(each, marks=pytest.mark.slow) for each in AT_LENGTH if can_play(each) and each not in BRIEFLY),
]


class Recording(TorchDispatchMode):
    """Refuses what a GPU cannot record: to read a result, and to make a tensor whose size is one."""

    operations = 0

    def __torch_dispatch__(self, function, types, args=(), kwargs=None):
        self.operations += 1
        sized = torch.Tag.dynamic_output_shape in function.tags
        if function is torch.ops.aten.index.Tensor:  # a mask is looked through for its cells
            sized = any(each is not None and each.dtype in (torch.bool, torch.uint8) for each in args[1])
        if sized or torch.Tag.data_dependent_output in function.tags:
            raise RuntimeError(f"{function} waits for a result")
        return function(*args, **(kwargs or {}))


def one_hot(codes, count):
    return (codes[..., None] == torch.arange(count)).long()


def waits(*given, **options):
    raise RuntimeError("a tensor is read")


def env_of(overrides, **options):
    plan = run_config(plain(compose_config("train", [*overrides, "landscape.size=16", "horizon=20"])))
    return WildfireEnv(plan.world, observation=plan.observation, reward=plan.reward, n_worlds=3, seed=2, **options)


@pytest.mark.parametrize("overrides", SCENARIOS, ids=" ".join)
def test_recorded_worlds_are_those_of_steps_and_no_size_in_one_depends_on_a_result(overrides, monkeypatch):
    with unread():
        eager, recorded = env_of(overrides), env_of(overrides, graph=True)
        one, other = eager.reset(), recorded.reset()
        for _ in range(2 + eager.world.steps_per_tick):
            action = eager.rand_action(one)["agents", "action"]
            one, other = (
                env.step(shown.set(("agents", "action"), action))["next"]
                for env, shown in ((eager, one), (recorded, other))
            )
            assert (one == other).all()
        for name, leaf in eager.world_state.leaves().items():
            assert torch.equal(recorded.world_state.leaves()[name], leaf), name
        for module in [each for each in sys.modules.values() if vars(each).get("one_hot") is functional.one_hot]:
            monkeypatch.setattr(module, "one_hot", one_hot)  # torch's reads the codes on a CPU, to check them
        step = RecordedStep(eager._scene)
        step._like = eager.world_state, eager.tree_counts
        given = [*eager.world_state.leaves().values(), *eager.tree_counts.leaves().values(), action]
        with monkeypatch.context() as patch, Recording() as recording:
            for name in ("tolist", "numpy", "__array__"):
                patch.setattr(torch.Tensor, name, waits)
            step._flat(given)
    assert recording.operations > 300


@pytest.mark.parametrize(
    "read",
    [
        lambda seen: bool(seen.any()),
        lambda seen: int(seen.sum()),
        lambda seen: seen.nonzero(),
        lambda seen: seen[seen],
        lambda seen: torch.masked_select(seen, seen),
        lambda seen: torch.equal(seen, seen),
        lambda seen: seen.unique(),
    ],
)
def test_what_a_gpu_cannot_record_is_refused(read):
    with Recording(), pytest.raises(RuntimeError, match="waits for a result"):
        read(torch.tensor([True, False]))


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
