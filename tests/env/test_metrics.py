"""Metrics are fractions, and say what happened."""

import pytest
import torch

from warp_torchrl.env.metrics import METRICS, metrics
from warp_torchrl.world.state.state import Action, count_trees


def test_metrics_are_fractions_that_add_up(make_small_env):
    env = make_small_env(8)
    env.rollout(30, break_when_any_done=False)
    found = metrics(env.world_state, env.tree_counts, env.world)
    assert tuple(found) == METRICS
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
