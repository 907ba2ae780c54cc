"""Environments of agents that do not see all and tell each other, at once and late."""

import pytest
import torch
from torchrl.envs.utils import check_env_specs

from tests.conftest import small_world
from warp_torchrl import make_env
from warp_torchrl.env import WildfireEnv, scene
from warp_torchrl.env.observation import Paper, Surroundings
from warp_torchrl.world.fires.imagined import imagined, rules_in_sight
from warp_torchrl.world.mechanics.sensing.sensing import Sight
from warp_torchrl.world.state.records import kept
from warp_torchrl.world.world import World

Radio = pytest.importorskip("warp_torchrl.world.mechanics.radio.radio").Radio
LATE = Radio(carries="both", delay=2, loss=0.2, range=9.0)


@pytest.mark.parametrize("radio", [Radio(carries="map"), LATE], ids=["at once", "late"])
def test_agents_know_the_same_in_any_batch_and_after_a_masked_reset(make_small_env, radio):
    world = small_world(horizon=7, sensing=Sight(radius=2, miss=0.2, smoke=1.0), mechanics=(radio,))
    many, one = make_small_env(4, world, seed=0), make_small_env(1, world, seed=2)
    ours, theirs = many.reset(), one.reset()
    for step in range(12):
        action = torch.full((4, 2), step % 9)
        ours, theirs = (
            env.step_and_maybe_reset(now.set(("agents", "action"), action[: len(now)]))[1]
            for env, now in ((many, ours), (one, theirs))
        )
        for key, value in theirs["agents"].items(include_nested=True, leaves_only=True):
            assert torch.equal(ours["agents"].get(key)[2:3], value), key
    assert many.world_state.step.max() < 7


def test_what_agents_know_is_kept_and_restored(make_small_env):
    world = small_world(sensing=Sight(radius=2), mechanics=(Radio(carries="map"),))
    env, other = make_small_env(3, world, seed=4), make_small_env(3, world, seed=9)
    env.rollout(6, break_when_any_done=False)
    other.load_state_dict(env.state_dict())
    assert torch.equal(kept(other.world_state), kept(env.world_state))


def late_env(make_small_env, n_worlds=3, seed=4, **options):
    world = small_world(horizon=7, sensing=Sight(), mechanics=(LATE,))
    return make_small_env(n_worlds, world, seed=seed, **options)


@pytest.mark.parametrize("observation", [Surroundings(), Paper()], ids=lambda each: type(each).__name__)
def test_what_was_sent_is_what_was_observed_so_many_steps_ago(make_small_env, observation):
    env = late_env(make_small_env, observation=observation)
    check_env_specs(env)
    now, observed, heard = env.reset(), [[] for _ in range(3)], False
    for turn in range(20):
        seen, sent = now["agents", "observation"].clone(), now["agents", "sent"].clone()
        for world, step in enumerate(env.world_state.step.tolist()):
            observed[world] = [*observed[world], seen[world]] if step else [seen[world]]  # an episode begins with none
            expected = observed[world][step - 2] if step >= 2 else torch.zeros_like(seen[world])
            assert (sent[world] == expected).all()
            hears = now["agents", "radio"][world, ..., 0]
            assert step >= 2 or not hears.any()
            heard |= bool(hears.any())
        step, now = env.step_and_maybe_reset(now.set(("agents", "action"), torch.randint(0, 9, (3, 2))))
        for world in step["next", "done"][:, 0].nonzero()[:, 0].tolist():  # its next episode has begun in its place
            assert (step["next", "agents", "sent"][world] == observed[world][-2]).all()
        if turn == 3:  # so that worlds end at different times
            now = env.reset(now.set("_reset", torch.tensor([[False], [True], [False]])))
    assert heard and (env._episodes >= 3).all(), "several episodes of each"


def test_without_delay_nothing_is_shown_of_before(make_small_env):
    env = make_small_env(2, small_world(sensing=Sight(), mechanics=(Radio(carries="both"),)))
    assert "sent" not in env.reset()["agents"].keys() and "sent" not in env.observation_spec["agents"].keys()
    silent = make_small_env(2, small_world(sensing=Sight(), mechanics=(Radio(carries="map", delay=2),)))
    assert "sent" not in silent.reset()["agents"].keys(), "no network reads it"
    assert silent.world_state.plane("radio", "shown") is None


def test_what_is_under_way_is_kept_and_restored(make_small_env):
    env, other = late_env(make_small_env), late_env(make_small_env, seed=9)
    env.rollout(4, break_when_any_done=False)
    other.load_state_dict(env.state_dict())
    for _ in range(6):
        ours, theirs = (
            each.step_and_maybe_reset(each._observe().set(("agents", "action"), torch.full((3, 2), 2)))[1]
            for each in (env, other)
        )
        assert (ours == theirs).all()
    without = {"worlds": {k: v for k, v in env.state_dict()["worlds"].items() if "extras.radio" not in k}}
    with pytest.raises(ValueError, match="worlds must have the entries"):
        other.load_state_dict({**env.state_dict(), **without})


def test_a_changed_world_keeps_what_is_under_way(make_small_env):
    env = late_env(make_small_env)
    env.rollout(4, break_when_any_done=False)
    before, shown = env._observe(), env.set_state(env.world_state)
    assert (shown["agents"] == before["agents"]).all() and shown["agents", "radio"].any()
    alone = env.world.reset(env.seeds, torch.zeros(3, dtype=torch.int64))
    with pytest.raises(ValueError, match="worlds must tell what their agents sent"):
        env.set_state(alone)


def test_steps_of_late_packets_are_not_compiled(monkeypatch):
    monkeypatch.setattr(scene, "check_compiler", lambda device: None)
    env = WildfireEnv(World(mechanics=(Radio(delay=1),)), n_worlds=1, fuse=True)
    assert "packets come late" in env.why_eager


def test_nothing_hides_fire_from_who_imagines():
    env = make_env("smoke", n_worlds=2, overrides=["landscape.size=12", "mechanics.radio.delay=1"])
    env.reset()
    world, state = rules_in_sight(env.world), imagined(env.world_state, env.world_state.key + 1, env.world)
    assert env.world.sensing.is_limited and not world.sensing.is_limited
    after = world.step(state, torch.zeros(2, env.n_agents, dtype=torch.int64)).after
    assert not after.keeps("sensing") and not after.keeps("radio")
