"""Metrics are fractions, and say what happened."""

import pytest
import torch

from tests.conftest import small_world
from warp_torchrl.env.metrics import METRICS, metric, metric_rows, metrics
from warp_torchrl.world.mechanics.mechanic import Metric
from warp_torchrl.world.state.cells import count_trees
from warp_torchrl.world.state.state import Action
from warp_torchrl.world.team.team import Team


def test_metrics_are_fractions_that_add_up(make_small_env):
    env = make_small_env(8)
    env.rollout(30, break_when_any_done=False)
    found = metrics(env.world_state, env.tree_counts, env.world)
    assert list(found) == list(METRICS)
    for name, value in found.items():
        assert value.shape == (8,) and ((value >= 0) & (value <= 1)).all(), name
    total = sum(found[name] for name in ("saved", "burned", "cleared", "burning"))
    assert torch.allclose(total, torch.ones(8))


def test_acts_are_counted_for_what_they_are(make_small_env):
    env = make_small_env(1)
    env.reset()
    state = env.world_state
    tree = ((state.cells[0] > 0) & (state.cells[0] <= 10)).nonzero()[0]
    state = state.replace(vehicles=state.vehicles.replace(position=tree.expand(1, 2, 2).clone()))
    after = env.world.step(state, torch.full((1, 2), int(Action.CLEAR))).after
    found = metrics(after, count_trees(after), env.world)
    assert found["actions"].item() == 1.0  # two agents, one step, two acts
    assert found["redundant"].item() == 0.5  # both at one tree
    assert found["cleared"].item() == pytest.approx(1.0 / count_trees(state).initial.item())
    assert found["control_time"].item() == pytest.approx(1.0 / env.world.horizon)


def test_a_user_s_metric_is_one_of_every_world(make_small_env, monkeypatch):
    monkeypatch.setattr("warp_torchrl.env.metrics.METRICS", {**METRICS})

    def spilt(now):
        return now.state.vehicles.tank.clamp(min=0).sum(1) / 100.0

    def saved(now):
        return spilt(now)

    metric(better="less")(spilt)
    env = make_small_env(2, small_world(team=Team(n_agents=2, tank=30)))
    stay = torch.full((2, 2), int(Action.STAY))
    now = env.step(env.reset().set(("agents", "action"), stay))["next"]
    assert now["info", "spilt"][:, 0].tolist() == pytest.approx([0.6, 0.6])
    assert metric_rows(env.world)[-1] == Metric("spilt", "less") and "spilt" in env_names(env)
    with pytest.raises(ValueError, match="saved must be a new metric's name"):
        metric()(saved)


def env_names(env):
    return env.full_observation_spec["info"].keys()
