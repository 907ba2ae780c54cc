"""The environment as TorchRL and its users see it."""

import copy
import logging

import pytest
import torch
from tensordict import TensorDict
from torchrl.envs import EnvCreator, ParallelEnv, SerialEnv
from torchrl.envs.utils import check_env_specs

from tests.conftest import small_world
from warp_torchrl import WildfireEnv, make_env
from warp_torchrl.env import scene
from warp_torchrl.env.layout import packed
from warp_torchrl.env.observation import Local, Paper, Surroundings
from warp_torchrl.env.reward import Efficiency
from warp_torchrl.world import eager
from warp_torchrl.world.air.wind import Paper as PaperWind
from warp_torchrl.world.backends.tick import in_wind
from warp_torchrl.world.law.fire import Fire
from warp_torchrl.world.state.cells import count_trees
from warp_torchrl.world.state.state import Action
from warp_torchrl.world.team.team import Team
from warp_torchrl.world.terrain.landscape import Perlin

STAY = int(Action.STAY)


def team_of(env, action=STAY):
    return torch.full((env.batch_size[0], env.n_agents), action)


def stepped(env, action):
    return env.step(TensorDict({"agents": {"action": action}}, batch_size=env.batch_size))["next"]


@pytest.mark.parametrize(
    "observation", [Surroundings(), Local(radius=2), Paper()], ids=lambda each: type(each).__name__
)
@pytest.mark.parametrize("n_agents", [1, 3])
def test_specs_hold_in_every_preset(make_small_env, observation, n_agents):
    world = small_world(team=Team(n_agents=n_agents, roles=("ugv", "uav")), wind=PaperWind())
    check_env_specs(make_small_env(3, world, observation=observation), break_when_any_done="both")


def test_keys_are_those_of_the_contract(make_small_env):
    env = make_small_env(2)
    rollout = env.rollout(5, break_when_any_done=False)
    assert rollout["agents", "observation", "view"].shape == (2, 5, 2, 11, 11, 11)
    assert rollout["agents", "observation", "picture"].shape == (2, 5, 2, 3, 15, 15)
    assert rollout["agents", "action_mask"].shape == (2, 5, 2, 11)
    assert rollout["agents", "action"].dtype == torch.int64
    assert rollout["next", "agents", "reward"].shape == (2, 5, 2, 1)
    assert rollout["state"].shape == (2, 5, 8, 16, 16)
    assert rollout["next", "info", "saved"].shape == (2, 5, 1)
    assert env.group_map == {"agents": ["bulldozer_0", "bulldozer_1"]}
    assert env.reward_keys == [("agents", "reward")] and set(env.done_keys) == {"done", "terminated", "truncated"}


@pytest.mark.parametrize("observation", [Surroundings(), Paper()], ids=lambda each: type(each).__name__)
def test_to_advance_is_a_step_without_the_critic_s_state(make_small_env, observation):
    ours, theirs = (make_small_env(3, observation=observation) for _ in range(2))
    ours.reset(), theirs.reset()
    for action in (0, 8, 9, STAY):
        seen, expected = packed(ours.advance(team_of(ours, action))), stepped(theirs, team_of(theirs, action))
        assert list(seen.keys(True, True)) == [key for key in expected.keys(True, True) if key != "state"]
        assert (seen == expected.exclude("state")).all()
    assert not expected["done"].all() and expected["info", "episode_reward"].abs().sum() > 0


def test_world_i_draws_with_seed_plus_i(make_small_env):
    together = make_small_env(3, seed=7)
    alone = make_small_env(1, seeds=[9])
    together.reset(), alone.reset()
    for _ in range(12):
        stepped(together, team_of(together)), stepped(alone, team_of(alone))
    assert (together.world_state.cells[2] == alone.world_state.cells[0]).all()


def test_set_seed_starts_again_at_episode_0(make_small_env):
    env = make_small_env(2, seed=5)
    first = env.reset()
    second = env.reset()
    env.set_seed(5, static_seed=True)
    again = env.reset()
    assert (again["state"] == first["state"]).all() and (second["state"] != first["state"]).any()


def test_only_the_worlds_that_ask_are_reset(make_small_env):
    env = make_small_env(3)
    env.reset()
    for _ in range(7):
        now = stepped(env, team_of(env))
    before = env.world_state.clone()
    fresh = WildfireEnv(env.world, n_worlds=1, seeds=[1])
    fresh.reset()
    fresh.reset()
    asked = now.clone().set("_reset", torch.tensor([[False], [True], [False]]))
    after = env.reset(asked)
    assert env.world_state.step.tolist() == [7, 0, 7]
    assert (env.world_state.cells[[0, 2]] == before.cells[[0, 2]]).all()
    assert (env.world_state.cells[1] == fresh.world_state.cells[0]).all(), "episode 1 of seed 1"
    assert (after["agents", "observation", "view"][[0, 2]] == now["agents", "observation", "view"][[0, 2]]).all()
    assert (after["agents", "observation", "view"][1] == fresh._observe()["agents", "observation", "view"][0]).all()


def test_the_counts_of_trees_are_those_of_the_worlds_now(make_small_env):
    env = make_small_env(5, small_world(horizon=9, team=Team(n_agents=3)))
    counted = []
    env.watcher = lambda transition: counted.append(
        [transition.counts_before.leaves(), count_trees(transition.before).leaves()]
    )

    def check():
        now, known = count_trees(env.world_state).leaves(), env.tree_counts.leaves()
        assert all(torch.equal(known[name], now[name]) for name in now)

    with pytest.raises(RuntimeError, match="call reset"):
        _ = env.tree_counts
    now = env.reset()
    for _ in range(30):  # over several ends, of all worlds and of some
        now["agents", "action"] = env.action_spec.rand()["agents", "action"]
        now = env.step_and_maybe_reset(now)[1]
        check()
    now["_reset"] = torch.tensor([[True], [False], [True], [False], [False]])
    env.reset(now)
    check()
    saved = env.state_dict()
    env.step(env.action_spec.rand())
    assert all(torch.equal(known[name], now[name]) for known, now in counted for name in now)
    env.load_state_dict(saved)
    check()
    env.set_state(env.world_state.replace(cells=torch.zeros_like(env.world_state.cells)))
    check()
    assert (env.tree_counts.alight == 0).all()


def test_a_rollout_goes_on_after_worlds_end(make_small_env):
    env = make_small_env(4, small_world(horizon=6))
    rollout = env.rollout(20, break_when_any_done=False)
    assert rollout["next", "done"].sum(1).flatten().tolist() == [3, 3, 3, 3]
    assert (rollout["info", "episode_length"][:, 6] == 0).all()


def test_a_finished_world_stays_as_it_is_and_earns_nothing(make_small_env):
    env = make_small_env(2, small_world(horizon=3))
    env.reset()
    for _ in range(3):
        now = stepped(env, team_of(env))
    assert now["truncated"].all() and now["done"].all()
    before = env.world_state.clone()
    now = stepped(env, team_of(env, int(Action.EXTINGUISH)))
    assert now["done"].all() and (now["agents", "reward"] == 0).all()
    assert (env.world_state.cells == before.cells).all() and (env.world_state.step == 3).all()
    assert (env.world_state.vehicles.acts == before.vehicles.acts).all()


def test_putting_out_the_last_fire_terminates(make_small_env):
    world = small_world(landscape=Perlin(size=12), fire=Fire(alpha=(0.0, 0.0, 0.0, 1e-6, 0.0)), horizon=400)
    env = make_small_env(2, world)
    env.reset()
    for _ in range(30):  # five ticks burn the first patch out, and nothing catches fire at alpha 1e-6
        now = stepped(env, team_of(env))
    assert now["terminated"].all() and not now["truncated"].any()


def test_lightning_worlds_end_only_at_the_horizon(make_small_env):
    world = small_world(fire=Fire(beta=1e-6, alpha=(0.0, 0.0, 0.0, 1e-6, 0.0)), horizon=60)
    env = make_small_env(1, world)
    env.reset()
    flags = [
        (now["terminated"].item(), now["truncated"].item()) for now in (stepped(env, team_of(env)) for _ in range(60))
    ]
    assert flags[-1] == (False, True) and not any(any(flag) for flag in flags[:-1])


def test_state_dict_goes_on_exactly(make_small_env):
    env, other = make_small_env(3, seed=2), make_small_env(3, seed=99)
    env.rollout(9, break_when_any_done=False)
    other.reset()
    other.load_state_dict(env.state_dict())
    for _ in range(50):
        ours, theirs = stepped(env, team_of(env)), stepped(other, team_of(other))
        assert (ours["state"] == theirs["state"]).all() and (
            ours["agents", "reward"] == theirs["agents", "reward"]
        ).all()
        mask = ours["done"]
        if mask.any():
            ours, theirs = env.reset(ours.set("_reset", mask)), other.reset(theirs.set("_reset", mask.clone()))
            assert (ours["state"] == theirs["state"]).all()


def test_load_state_dict_changes_nothing_when_it_does_not_fit(make_small_env):
    env, bigger = make_small_env(2), make_small_env(3)
    env.reset(), bigger.reset()
    before = env.world_state.cells.clone()
    with pytest.raises(ValueError, match="must be"):
        env.load_state_dict(bigger.state_dict())
    assert (env.world_state.cells == before).all() and len(env.state_dict()["seeds"]) == 2


def test_load_state_dict_asks_for_every_entry_unless_it_is_not_strict(make_small_env):
    env, other = make_small_env(2, seed=7), make_small_env(2, seed=1)
    other.reset()
    cells = other.world_state.cells.clone()
    part = {"seeds": env.state_dict()["seeds"]}
    with pytest.raises(ValueError, match="state_dict must have episodes, episode_reward, worlds, got seeds"):
        other.load_state_dict(part)
    assert other.seeds.tolist() == [1, 2]
    other.load_state_dict(part, strict=False)
    assert other.seeds.tolist() == [7, 8] and (other.world_state.cells == cells).all()
    assert other.state_dict()["episodes"].tolist() == [1, 1]


def test_without_a_seed_copies_differ_and_go_on_from_what_they_drew(make_small_env):
    env = make_small_env(2, seed=None)
    copied = copy.deepcopy(env)
    one, other = env.reset()["state"], copied.reset()["state"]
    assert (one != other).any() and env.seeds.min() >= 2**31 and env.seeds.diff() == 1
    again = make_small_env(2, seeds=env.seeds.tolist())
    assert (again.reset()["state"] == one).all() and (again.reset()["state"] == env.reset()["state"]).all()


@pytest.mark.parametrize("seed", [0, None])
def test_torchrl_s_creator_takes_a_function(seed):
    worlds = SerialEnv(2, EnvCreator(lambda: make_env("skirmish", n_worlds=2, seed=seed)))
    first = worlds.rollout(3)["state"][:, :, 0]
    assert first.shape == (2, 2, 8, 16, 16) and (first[0] == first[1]).all() == (seed is not None)
    worlds.set_seed(5)
    first = worlds.reset()["state"]
    assert (first[0] != first[1]).any(), "TorchRL gives each a seed of its own"
    worlds.load_state_dict(worlds.state_dict())


@pytest.mark.slow
def test_torchrl_s_parallel_environments_take_a_function():
    worlds = ParallelEnv(2, lambda: make_env("skirmish", n_worlds=2))
    assert worlds.rollout(3)["agents", "action"].shape == (2, 2, 3, 2)
    worlds.load_state_dict(worlds.state_dict())
    worlds.close()


def test_set_state_goes_on_from_given_worlds(make_small_env):
    env, other = make_small_env(2, seed=3), make_small_env(2, seed=50)
    env.reset(), other.reset()
    stepped(env, team_of(env))
    seen = other.set_state(env.world_state)
    assert (seen["state"] == env._observe()["state"]).all()
    assert (stepped(env, team_of(env))["state"] == stepped(other, team_of(other))["state"]).all()
    with pytest.raises(ValueError, match="state must have"):
        other.set_state(_reset_state(make_small_env(1)))


def test_a_state_whose_wind_was_changed_burns_in_that_wind(make_small_env):
    env = make_small_env(2)
    env.reset()
    before = env.world.forecast(env.world_state).fire_risk()
    gale = torch.full_like(env.world_state.wind, 15.0)
    env.set_state(in_wind(env.world_state, env.world.fire, gale))
    spread = env.world.fire.spread_probability(env.world_state)
    assert not torch.equal(env.world.forecast(env.world_state).fire_risk(), before)
    rows, columns = env.world.size
    field = gale.expand(2, 2, rows, columns).clone()  # the same, cell by cell
    env.set_state(in_wind(env.world_state, env.world.fire, field))
    assert not env.world_state.air.terms.leaves()
    torch.testing.assert_close(env.world.fire.spread_probability(env.world_state), spread)


def _reset_state(env):
    env.reset()
    return env.world_state


@pytest.mark.parametrize(
    ("action", "message"),
    [
        (torch.full((2, 2), 11), "must be in 0..10, got 11..11"),
        (torch.full((2, 2), -1), "must be in 0..10"),
        (torch.zeros(2, 2), "must be int64"),
        (torch.zeros(2, 3, dtype=torch.int64), "must be int64 of shape"),
        (None, "must be given"),
    ],
)
def test_bad_actions_are_refused_in_one_line_and_change_nothing(make_small_env, action, message):
    env = make_small_env(2)
    env.reset()
    before = env.world_state.clone()
    with pytest.raises(ValueError, match=message) as error:
        env._step(TensorDict({} if action is None else {"agents": {"action": action}}, batch_size=[2]))
    assert "\n" not in str(error.value)
    assert (env.world_state.step == before.step).all()


@pytest.mark.parametrize(
    ("options", "message"),
    [({"n_worlds": 0}, "n_worlds"), ({"seeds": [1]}, "seeds"), ({"seed": -1}, "seed must be")],
)
def test_bad_options_are_refused(make_small_env, options, message):
    with pytest.raises(ValueError, match=message):
        make_small_env(**{"n_worlds": 2, **options})


def test_the_environment_asks_for_a_reset_first(make_small_env):
    with pytest.raises(RuntimeError, match="reset"):
        _ = make_small_env(1).world_state


def test_it_renders_every_world(make_small_env):
    env = make_small_env(3)
    env.reset()
    assert env.render(scale=4).shape == (3, 48, 48, 3)


@pytest.mark.cuda
@pytest.mark.skipif(not torch.cuda.is_available(), reason="needs a CUDA device")
def test_cuda_equals_cpu_and_a_step_does_not_synchronise():
    ours, theirs = WildfireEnv(small_world(), n_worlds=4), WildfireEnv(small_world(), n_worlds=4, device="cuda")
    ours.reset(), theirs.reset()
    action = team_of(theirs).cuda()  # a copy to the device waits
    stepped(theirs, action)
    stepped(ours, team_of(ours))
    torch.cuda.set_sync_debug_mode("error")
    try:
        for _ in range(20):
            theirs._step(TensorDict({"agents": {"action": action}}, batch_size=[4]))
    finally:
        torch.cuda.set_sync_debug_mode("default")
    for _ in range(20):
        stepped(ours, team_of(ours))
    assert (ours.world_state.cells == theirs.world_state.cells.cpu()).all()


def test_another_reward_may_be_given_to_an_environment(make_small_env):
    env = make_small_env(2)
    env.reset()
    env.reward_function = Efficiency(act=1000.0, act_per="forest")
    acting = torch.full((2, env.n_agents), int(Action.EXTINGUISH))
    reward = env.step(env.full_done_spec.zero().set(("agents", "action"), acting))["next", "agents", "reward"]
    assert (reward < -900.0).all()


def test_steps_that_are_not_compiled_are_told_in_one_line(caplog, monkeypatch):
    monkeypatch.setattr(eager, "vectors", lambda: "AVX2")
    monkeypatch.setattr(scene, "check_compiler", lambda device: None)
    with caplog.at_level(logging.INFO, logger="warp_torchrl"):
        few, many = (WildfireEnv(n_worlds=n, fuse=True) for n in (32, 33))
    assert few.why_eager is None
    assert [record.getMessage() for record in caplog.records] == [f"compile: {many.why_eager}"]
    assert "33792 cells is faster eager with AVX2" in many.why_eager
    monkeypatch.setattr("warp_torchrl.env.scene.compiled", None)  # a compiled step would call it
    many.rand_step(many.reset())


def test_worlds_that_cannot_fit_in_memory_are_refused_before_they_are_made(monkeypatch):
    monkeypatch.setattr("warp_torchrl.system.memory.available", lambda: 10**9)
    world = small_world(landscape=Perlin(size=4096))
    line = r"n_worlds must fit in memory: 4 of 4096 x 4096 cells need 1\.1 GB, got 1\.0 GB: take fewer worlds"
    with pytest.raises(ValueError, match=line):
        WildfireEnv(world, n_worlds=4)
    assert WildfireEnv(world, n_worlds=3).batch_size == (3,)
