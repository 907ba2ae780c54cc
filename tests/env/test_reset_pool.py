"""Starts that are taken by masks are those that would have been made when needed."""

import pytest
import torch

from tests.conftest import small_world
from tests.world.mechanics.there import can_play
from warp_torchrl import make_env
from warp_torchrl.env import WildfireEnv
from warp_torchrl.env.reset_pool import ResetPool
from warp_torchrl.system.device import unread

SHORT = ["landscape.size=10", "horizon=5"]
LATE = ["scenario=search", "mechanics.radio.carries=both", "mechanics.radio.delay=2", "mechanics.radio.loss=0.2"]
TALKS = ["mechanics.radio.carries=graph", "mechanics.radio.delay=2"]
AT_LENGTH = [["scenario=lightning"], ["wind=wandering"], LATE]


def played(steps, *overrides):
    """What a batch of worlds shows in steps of actions drawn from a seed, and the worlds."""
    env = make_env("skirmish", n_worlds=6, seed=4, overrides=[*SHORT, *overrides])
    generator, shown, seen = torch.Generator().manual_seed(0), env.reset(), []
    for _ in range(steps):
        shown["agents", "action"] = torch.randint(0, 9, (6, env.n_agents), generator=generator)
        step, shown = env.step_and_maybe_reset(shown)
        seen += [step["next"].flatten_keys("."), shown.exclude(("agents", "action")).flatten_keys(".")]
    return seen, env


@pytest.mark.parametrize(
    "overrides",
    [
        *filter(can_play, [[], ["scenario=front"], TALKS]),
        *(pytest.param(each, marks=pytest.mark.slow) for each in AT_LENGTH if can_play(each)),
    ],
    ids=" ".join,
)
def test_worlds_play_the_same_episodes_though_nobody_asks_which_have_ended(overrides):
    expected, env = played(18, *overrides)
    with unread():
        found, other = played(18, *overrides)
    assert (env._episodes > 3).all()
    for name, value in env.state_dict()["worlds"].items():
        assert torch.equal(other.state_dict()["worlds"][name], value), name
    assert torch.equal(env.state_dict()["episodes"], other.state_dict()["episodes"])
    for one, same in zip(expected, found, strict=True):
        assert one.keys() == same.keys()
        for name, value in one.items():
            assert torch.allclose(value.double(), same[name].double(), atol=1e-6), name


def test_a_partial_reset_starts_those_worlds_alone():
    with unread():
        env = make_env("skirmish", n_worlds=3, seed=4, overrides=SHORT)
        shown = env.reset()
        for _ in range(3):
            shown = env.step(env.rand_action(shown))["next"]
        before = env.world_state.clone()
        mask = torch.tensor([[False], [True], [False]])
        env.reset(shown.clone(recurse=True).set("_reset", mask))
    assert env.world_state.step.tolist() == [3, 0, 3] and env._episodes.tolist() == [1, 2, 1]
    wanted = env.world.reset(torch.tensor([5]), torch.tensor([1]))
    assert torch.equal(env.world_state.cells[1:2], wanted.cells)
    assert torch.equal(env.world_state.cells[::2], before.cells[::2])


def test_a_world_whose_starts_have_run_out_waits_and_misses_none():
    with unread():
        env = WildfireEnv(small_world(), n_worlds=2, seed=3)
        shown = env.reset()
        env._resets = ResetPool(env._start, env.world.check, steps=4, ready=2)
        ended, began = torch.tensor([True, False]), []
        for _ in range(8):
            env._masked_reset(env._resets, ended, shown)
            began.append(env._episodes.tolist())
    assert began == [[2, 1], [3, 1], [3, 1], [3, 1], [4, 1], [5, 1], [5, 1], [5, 1]]
    wanted = env.world.reset(torch.tensor([3]), torch.tensor([4]))
    assert torch.equal(env.world_state.key[:1], wanted.key) and torch.equal(env.world_state.cells[:1], wanted.cells)


def test_other_seeds_have_other_starts():
    with unread():
        env = WildfireEnv(small_world(), n_worlds=2, seed=3)
        shown = env.reset()
        env._masked_reset(env._resets, torch.tensor([True, True]), shown)
        env.set_seeds([8, 9])
        env._masked_reset(env._resets, torch.tensor([True, True]), shown)
    wanted = env.world.reset(torch.tensor([8, 9]), torch.tensor([0, 0]))
    assert torch.equal(env.world_state.key, wanted.key)


def test_faulty_starts_are_told_at_the_next_filling():
    with unread():
        env = WildfireEnv(small_world(), n_worlds=2, seed=3)
        shown, ended = env.reset(), torch.tensor([True, True])
        start = env._start
        pool = ResetPool(lambda *of: (start(*of)[0], torch.tensor([True, False])), env.world.check, steps=1)
        with pytest.raises(ValueError, match="no tree"):
            for _ in range(2):
                pool.take(ended, (*env._current(), shown), env.seeds, env._episodes)
