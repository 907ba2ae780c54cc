"""Limited sight in play: what is measured, reported, compared and compiled."""

import torch

from tests.conftest import small_world
from warp_torchrl.env import WildfireEnv, scene
from warp_torchrl.env.metrics import METRICS, metrics
from warp_torchrl.env.reward import Monitor
from warp_torchrl.evaluation.goal import goal
from warp_torchrl.evaluation.play import BASELINES, baselines_of, play
from warp_torchrl.evaluation.report import WATCHING, report
from warp_torchrl.heuristics import Follower, Random
from warp_torchrl.world.fires.imagined import rules_in_sight
from warp_torchrl.world.mechanics.sensing.sensing import Sight
from warp_torchrl.world.mechanics.sensing.watching import memory_of
from warp_torchrl.world.team.team import Team
from warp_torchrl.world.world import World


def test_steps_of_agents_that_do_not_see_all_are_not_compiled(monkeypatch):
    monkeypatch.setattr(scene, "check_compiler", lambda device: None)
    env = WildfireEnv(World(sensing=Sight()), n_worlds=1, fuse=True)
    assert "do not see all" in env.why_eager and WildfireEnv(n_worlds=1, fuse=True).why_eager is None


def test_limited_sight_has_metrics_of_its_own(make_small_env):
    env = make_small_env(4, small_world(sensing=Sight(radius=2), team=Team(n_agents=2, roles=("scout",))))
    now = env.rollout(20, break_when_any_done=False)
    found = metrics(env.world_state, env.tree_counts, env.world)
    assert tuple(found) == (*METRICS, *WATCHING)
    assert set(now["next", "info"].keys()) == {*found, "episode_reward", "episode_length"} == {*env_names(env)}
    for name, value in found.items():
        assert ((value >= 0) & (value <= 1)).all(), name
        assert torch.equal(now["next", "info", name][:, -1, 0], value)
    state = env.world_state
    memory = memory_of(state).replace(
        fronts=torch.full((4,), 4, dtype=torch.int32),
        watched=torch.ones(4),
        found=torch.full((4,), 2.0),
        uncertainty=torch.full((4,), 6.0),
    )
    step = torch.full((4,), 8, dtype=torch.int32)
    state = state.replace(step=step).with_planes("sensing", memory)
    found = metrics(state, env.tree_counts, env.world)
    assert [found[name][0].item() for name in WATCHING] == [0.25, 0.5, 0.75]


def env_names(env):
    return env.full_observation_spec["info"].keys()


def test_those_that_search_are_baselines_where_sight_is_limited():
    assert baselines_of(small_world()) == BASELINES
    assert baselines_of(small_world(sensing=Sight())) == (*BASELINES, "oldest", "lawnmower", "follower")


def test_a_report_of_a_team_that_watches_keeps_what_its_baselines_watched():
    team = Team(n_agents=2, roles=("scout",))
    env = WildfireEnv(small_world(sensing=Sight(), team=team), reward=Monitor(), n_worlds=3)
    mine, follower = play(env, Random(env), 9), play(env, Follower(env), 9)
    content = report("tiny", "random", 9, mine, {"follower": follower}, goal=goal(env.world))
    assert content["goal"] == "watched"
    assert content["baseline_episodes"]["follower"]["watched"] == follower["watched"].tolist()
    assert report("tiny", "random", 9, mine, {"follower": follower})["baseline_episodes"]["follower"].keys() == {
        "saved",
        "success",
    }


def test_futures_are_imagined_in_full_sight():
    world = small_world(sensing=Sight())
    assert rules_in_sight(world) == small_world() and rules_in_sight(small_world()) == small_world()
