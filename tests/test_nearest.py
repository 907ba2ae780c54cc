"""Names that a user may have meant."""

import pytest

from warp_torchrl.nearest import did_you_mean, nearest

KEYS = ["seed", "scenario", "n_worlds", "reward", "reward.gamma", "algorithm", "algorithm.gamma", "collector.steps"]


@pytest.mark.parametrize(
    ("name", "meant"),
    [
        ("sede", ["seed"]),
        ("sceanrio", ["scenario"]),
        ("Seed", ["seed"]),
        ("num_worlds", ["n_worlds"]),
        ("algorithm.gama", ["algorithm.gamma"]),  # in its group
        ("steps", ["collector.steps"]),  # without its group
        ("gamma", ["reward.gamma", "algorithm.gamma"]),
        ("algoritm.gamma", ["algorithm.gamma", "reward.gamma"]),  # the whole name tells which comes first
        ("algoritm.gama", ["algorithm.gamma"]),
        ("foo", []),
        ("", []),
    ],
)
def test_the_nearest_key_is_found(name, meant):
    assert nearest(name, KEYS) == meant


def test_it_ends_a_message():
    assert did_you_mean("gredy", ["greedy", "local"]) == ": did you mean greedy?"
    assert did_you_mean("gamma", KEYS) == ": did you mean reward.gamma or algorithm.gamma?"
    assert did_you_mean(None, KEYS) == did_you_mean("xyz", []) == ""
