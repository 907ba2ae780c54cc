"""Worlds that have ended are left alone, and every number is that of a loop over all steps of all worlds."""

import numpy as np
import pytest
import torch

from tests.conftest import small_world
from warp_torchrl.algorithms.ppo import Ppo
from warp_torchrl.env import WildfireEnv
from warp_torchrl.env.observation import Paper, Surroundings
from warp_torchrl.evaluation import play as play_module
from warp_torchrl.evaluation.episode_batch import EpisodeBatch, fits
from warp_torchrl.evaluation.play import WithoutAgent, play
from warp_torchrl.heuristics import HEURISTICS, Greedy
from warp_torchrl.models import Mlp, signature
from warp_torchrl.world.team.team import Team


def trained(env, **options):
    torch.manual_seed(1)
    return Ppo().policy(signature(env), Mlp(**options))


def alike(one, other):
    assert one.keys() == other.keys()
    return all(np.array_equal(one[name], other[name], equal_nan=True) for name in one)


@pytest.mark.parametrize("name", [name for name in HEURISTICS if not HEURISTICS[name].is_stateful])
@pytest.mark.parametrize("watch", [pytest.param(False, marks=pytest.mark.slow), True], ids=["", "watched"])
def test_a_heuristic_plays_as_step_by_step(name, watch, monkeypatch):
    env = WildfireEnv(small_world(team=Team(n_agents=2, roles=("ugv", "uav")), horizon=8), n_worlds=9)
    policy = HEURISTICS[name](env)
    assert fits(env, policy)
    quick, state = play(env, policy, 5, watch=watch), env.world_state
    monkeypatch.setattr(play_module, "fits", lambda env, policy: False)
    assert alike(quick, play(env, policy, 5, watch=watch))
    leaves = env.world_state.leaves()
    assert all(torch.equal(leaf, leaves[name]) for name, leaf in state.leaves().items())


@pytest.mark.parametrize("mode", ["sampled", pytest.param("deterministic", marks=pytest.mark.slow)])
@pytest.mark.parametrize("observation", [Surroundings(), Paper()], ids=["surroundings", "paper"])
@pytest.mark.parametrize("lamed", [False, True], ids=["", "without an agent"])
def test_a_trained_policy_plays_as_step_by_step(mode, observation, lamed, monkeypatch):
    env = WildfireEnv(small_world(horizon=12), observation=observation, n_worlds=9)
    policy = trained(env, sharing="role", symmetry="none")
    policy = WithoutAgent(policy, 1, env.world.team) if lamed else policy
    assert fits(env, policy)
    quick = play(env, policy, 5, mode, watch=True)
    monkeypatch.setattr(play_module, "fits", lambda env, policy: False)
    assert alike(quick, play(env, policy, 5, mode, watch=True))


@pytest.mark.slow
def test_heuristics_play_side_by_side_as_they_do_alone(make_small_env, monkeypatch):
    env, names = make_small_env(7, small_world(horizon=14)), tuple(HEURISTICS)
    abreast = play_module.play_heuristics(env, 5, names)
    monkeypatch.setattr(play_module, "_CELLS_ABREAST", 0)
    monkeypatch.setattr(play_module, "fits", lambda env, policy: False)
    alone = play_module.play_heuristics(env, 5, names)
    assert list(abreast) == list(alone) == list(names)
    assert all(alike(abreast[name], alone[name]) for name in names)


def test_a_match_goes_on_with_the_worlds_that_have_not_ended(make_small_env, monkeypatch):
    env, sizes = make_small_env(32), []
    step = EpisodeBatch._step
    monkeypatch.setattr(EpisodeBatch, "_step", lambda self, action: (sizes.append(len(self.rows)), step(self, action)))
    play(env, Greedy(env), 0)
    assert sizes[0] == 32 and sorted(sizes, reverse=True) == sizes and 1 <= sizes[-1] < 32
    assert env.world_state.done.all()


def test_what_reads_more_is_played_step_by_step(make_small_env):
    env = make_small_env(2)
    assert not fits(env, trained(env, memory=8)), "it remembers"
    assert not fits(env, HEURISTICS["ring"](env)), "it plans"
    assert not fits(env, WithoutAgent(Greedy(env), 0, env.world.team)), "it reads the environment's worlds"
    assert not fits(env, Mlp().critic(signature(env), central=True)), "it reads the state"

    class Mine(Greedy):
        pass

    assert not fits(env, Mine(env)), "it may read the environment's worlds"
    env.watcher = lambda transition: None
    assert not fits(env, Greedy(env))
