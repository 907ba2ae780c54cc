"""Worlds of several levels in one batch are those that they would be alone."""

from dataclasses import replace

import pytest
import torch
from torchrl.envs.utils import check_env_specs

from tests.conftest import small_world
from warp_torchrl.env import LeveledEnv, WildfireEnv
from warp_torchrl.env.levels import LEVEL, joined
from warp_torchrl.world.air.wind import Uniform
from warp_torchrl.world.ignition.ignition import Ignition
from warp_torchrl.world.law.fire import Fire

TARGET = small_world(horizon=12)
EASY = replace(TARGET, steps_per_tick=6, horizon=20)
CALM = replace(TARGET, ignition=Ignition(count=2), wind=Uniform(speed=1.0), fire=Fire(slope_gain=0.3, wind_gain=0.2))
LEVELS = [EASY, CALM, TARGET]


def leveled(n_worlds=16, chances=(0.4, 0.3, 0.3), **options):
    env = LeveledEnv(LEVELS, n_worlds=n_worlds, **options)
    env.draw_by(chances)
    return env


def played(env, steps, seed=0):
    """Play random actions, the same for world i of any batch, and return what was shown at each step."""
    shown, found = env.reset(), []
    for step in range(steps):
        draws = [
            torch.randint(11, (2,), generator=torch.Generator().manual_seed(997 * step + int(s))) for s in env.seeds
        ]
        shown["agents", "action"] = torch.stack(draws)
        at, shown = env.step_and_maybe_reset(shown)
        found.append(at.clone())
    return torch.stack(found, dim=1)


def same(one, other):
    for key, value in other.items(include_nested=True, leaves_only=True):
        assert torch.equal(one[key], value), key


def test_it_is_an_environment_of_torchrl():
    check_env_specs(leveled(n_worlds=3))
    env = leveled(n_worlds=3)
    assert env.reset()[LEVEL].tolist() == env.level[:, None].tolist()


def test_with_all_chances_at_the_target_it_is_the_plain_environment():
    same(played(leveled(chances=(0.0, 0.0, 1.0)), 15), played(WildfireEnv(TARGET, n_worlds=16), 15))


def test_the_least_and_the_largest_draw_are_of_levels_that_have_a_chance(monkeypatch):
    env, seeds = leveled(n_worlds=2, chances=(0.0, 0.5, 0.5)), torch.arange(3)
    draws = torch.tensor([[0.0], [0.5], [1.0 - 2.0**-24]])  # of [0, 1): one half is the first of the second half
    monkeypatch.setattr("warp_torchrl.env.levels.uniform", lambda *given: draws)
    assert env.drawn(seeds, seeds).tolist() == [1, 2, 2]


def test_what_comes_late_comes_as_in_the_plain_environment():
    radio = pytest.importorskip("warp_torchrl.world.mechanics.radio.radio")
    late = replace(TARGET, mechanics=(radio.Radio(carries="graph", delay=2, loss=0.2),))
    env = LeveledEnv([replace(late, steps_per_tick=6), late], n_worlds=8)
    same(played(env, 15), played(WildfireEnv(late, n_worlds=8), 15))
    env.draw_by([0.5, 0.5])
    env.rollout(15, break_when_any_done=False)
    other = LeveledEnv(env.levels, n_worlds=8, seed=9)
    other.load_state_dict(env.state_dict())
    assert env.level.unique().tolist() == [0, 1] and (env._observe() == other._observe()).all()


@pytest.mark.parametrize("level", range(3))
def test_a_world_s_episode_is_that_of_its_level_alone(level):
    mixed = played(leveled(), 12)
    alone = played(WildfireEnv(LEVELS[level], n_worlds=16), 12)
    rows = mixed[LEVEL][:, 0, 0] == level  # the level of each world's first episode
    assert 0 < rows.sum() < 16
    same(mixed[rows], alone[rows])


def test_episodes_have_the_horizon_of_the_level_that_they_started_at():
    found = played(leveled(), 36)
    ended, length = found["next", "done"][..., 0], found["next", "info", "episode_length"][..., 0]
    cut = found["next", "truncated"][..., 0]
    for level, world in enumerate(LEVELS):
        its = cut & (found["next", *LEVEL][..., 0] == level)
        assert its.any() and (length[its] == world.horizon).all()
    changed = found[LEVEL][:, 1:, 0] != found[LEVEL][:, :-1, 0]
    assert changed.any() and not (changed & ~ended[:, :-1]).any()


def test_levels_are_drawn_by_their_chances_and_alike_in_any_batch():
    env = leveled(n_worlds=4, chances=(0.5, 0.0, 0.5))
    seeds, episodes = torch.arange(4000), torch.arange(4000) % 7
    drawn = env.drawn(seeds, episodes)
    assert drawn.bincount(minlength=3).div(4000.0).tolist() == pytest.approx([0.5, 0.0, 0.5], abs=0.03)
    assert torch.equal(env.drawn(seeds[100:110], episodes[100:110]), drawn[100:110])
    assert not torch.equal(env.drawn(seeds, episodes + 1), drawn)


def test_chances_that_change_hold_for_the_next_start():
    env = leveled(chances=(1.0, 0.0, 0.0))
    worlds = torch.arange(16)[:, None]
    env.reset(env.reset().set("_reset", worlds < 5))  # makes the next starts of all of them, of which 11 lie ready
    assert env.level.tolist() == [0] * 16
    env.draw_by((0.0, 1.0, 0.0))
    env.reset(env._observe().set("_reset", worlds >= 12))
    assert env.level.tolist() == [0] * 12 + [1] * 4


def test_a_state_that_is_restored_goes_on_as_it_would_have():
    first, second = leveled(), leveled(seed=77)
    played(first, 9)
    second.load_state_dict(first.state_dict())
    second.load_state_dict({})  # what TorchRL's collectors keep of it
    assert len(set(first.level.tolist())) == 3 and torch.equal(first.level, second.level)
    shown = [first._observe(), second._observe()]
    for _ in range(13):
        action = torch.randint(11, (16, 2))
        both = [
            env.step_and_maybe_reset(seen.set(("agents", "action"), action))
            for env, seen in zip((first, second), shown)
        ]
        same(both[0][0], both[1][0])
        shown = [each[1] for each in both]


@pytest.mark.parametrize(
    ("change", "line"),
    [
        (lambda state: state.pop("level"), "state_dict must have level"),
        (lambda state: state.update(level=torch.zeros(3, dtype=torch.int64)), r"level must be \[4\] of 0..2"),
        (lambda state: state.update(level=torch.full((4,), 3)), r"level must be \[4\] of 0..2, got \[3, 3, 3, 3\]"),
        (lambda state: state.update(episodes=torch.zeros(3)), "episodes must have shape"),
    ],
)
def test_a_state_that_does_not_fit_changes_nothing(change, line):
    env = leveled(n_worlds=4)
    env.reset()
    before, state = env.state_dict(), leveled(n_worlds=4, seed=9).state_dict()
    change(state)
    with pytest.raises(ValueError, match=line):
        env.load_state_dict(state)
    assert torch.equal(env.level, before["level"]) and torch.equal(env.seeds, before["seeds"])


def test_parts_are_joined_in_the_order_of_the_worlds():
    parts = [({"a": torch.tensor([1, 4])}, None), ({"a": torch.tensor([2, 3])}, None)]
    made, nothing = joined(parts, torch.tensor([0, 2, 3, 1]))
    assert made["a"].tolist() == [1, 2, 3, 4] and nothing is None
