"""The rules that agents are told, by hand."""

import math

import pytest
import torch

from warp_torchrl.api.make import make_env
from warp_torchrl.entries import Vector
from warp_torchrl.env.observation.rules import RULES, rules_of
from warp_torchrl.models import signature

FIRST = len(RULES.names)


def told(scenario, *overrides):
    env = make_env(scenario, n_worlds=2, overrides=["observation=surroundings", "observation.rules=true", *overrides])
    own = env.reset()["agents", "observation", "status"]
    assert env.channel_names["status"][-FIRST:] == RULES.names
    assert torch.equal(own[:, :, -FIRST:], rules_of(env.world, env.device).expand(2, -1, -1))
    return [dict(zip(RULES.names, each, strict=True)) for each in own[0, :, -FIRST:].tolist()]


def test_the_rules_of_default_by_hand():
    """A tick every step; four stages of eight ticks each spread; wet for ten times as long."""
    for its in told("default"):
        assert its == pytest.approx(
            {
                "rule_ticks": 1.0,
                "rule_burning": math.log2(33) / 16,
                "rule_wet": math.log2(81) / 16,
                "rule_horizon": 8 / 16,
                "rule_tank": 0.0,
                "rule_stride": 0.25,
                "rule_team": 2 / 8,
                "rule_map": 5 / 16,
            }
        )


@pytest.mark.parametrize(
    ("scenario", "overrides", "name", "value"),
    [
        ("water", [], "rule_tank", 1 / 9),
        ("ring", [], "rule_tank", 1.0),
        ("default", ["team.n_agents=8"], "rule_team", 3 / 8),
        ("default", ["landscape.size=64"], "rule_map", 6 / 16),
        ("default", ["horizon=512"], "rule_horizon", 9 / 16),
        ("spread_default", [], "rule_ticks", 0.2),
        ("default", ["fire.burning_stages=2"], "rule_burning", math.log2(17) / 16),
        ("default", ["fire.wet_ticks=3"], "rule_wet", math.log2(25) / 16),
    ],
)
def test_a_rule_that_differs_is_told(scenario, overrides, name, value):
    assert all(each[name] == pytest.approx(value) for each in told(scenario, *overrides))


def test_each_role_is_told_its_own_stride():
    env = make_env("hetero", n_worlds=1)
    stride = env.world.team.table(env.device).stride
    assert [each["rule_stride"] for each in told("hetero")] == (stride / 4).tolist() and len(set(stride.tolist())) == 2


def test_rules_are_told_on_request_alone_and_do_not_turn():
    without, with_rules = (
        signature(
            make_env("default", n_worlds=1, overrides=["observation=surroundings", f"observation.rules={asked}"])
        ).observation["status"]
        for asked in ("false", "true")
    )
    assert with_rules.names == (*without.names, *RULES.names)
    assert with_rules.symmetry == Vector((*without.symmetry.parts, RULES)) and RULES.kind == "scalar"
