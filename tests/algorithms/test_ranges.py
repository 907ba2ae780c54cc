"""The numbers that algorithms take: both ends of each range, and nothing beyond."""

import math

import pytest

from warp_torchrl.algorithms.a2c import A2c
from warp_torchrl.algorithms.ddpg import Ddpg
from warp_torchrl.algorithms.dqn import Dqn
from warp_torchrl.algorithms.ppo import Ppo
from warp_torchrl.algorithms.sac import Sac

SHARE, LARGE = (0.0, 1.0), (1, 10**9)
ALL = {"gamma": SHARE, "learning_rate": SHARE, "learning_rate_end": SHARE, "max_grad_norm": (1e-6, 1e6)}
ON_POLICY = ALL | {
    "lmbda": SHARE,
    "entropy_coeff": SHARE,
    "entropy_coeff_end": SHARE,
    "critic_coeff": (0.0, 100.0),
    "minibatch_size": (1, 1_000_000),
}
OFF_POLICY = ALL | {
    "capacity": LARGE,
    "minibatch_size": LARGE,
    "updates": LARGE,
    "warm_up": (0, 10**9),
    "target_interval": (0, 10**9),
    "tau": (1e-6, 1.0),
    "n_step": (1, 1024),
}
EPSILON = {"epsilon": SHARE, "epsilon_end": (0.0, 0.5), "epsilon_until": (1e-6, 1.0)}
RANGES = {
    Ppo: ON_POLICY | {"clip_epsilon": (1e-4, 1.0), "epochs": (1, 1000)},
    A2c: ON_POLICY,
    Dqn: OFF_POLICY | EPSILON | {"mixer_hidden": (1, 8192)},
    Ddpg: OFF_POLICY | EPSILON | {"temperature": (1e-3, 100.0), "logit_penalty": (0.0, 1000.0)},
    Sac: OFF_POLICY | {"temperature": (1e-6, 100.0), "target_entropy": SHARE},
}
TOGETHER = {
    "capacity": {"warm_up": 0},
    "warm_up": {"capacity": 10**9},
    "epsilon": {"epsilon_end": 0.0},
    "epsilon_end": {"epsilon": 0.5},
}
"""What must be so for a field's whole range to be open."""


def beyond(end: float, way: float) -> float:
    return end + int(way) if isinstance(end, int) else math.nextafter(end, way * math.inf)


@pytest.mark.parametrize(("algorithm", "field"), [(each, field) for each, ranges in RANGES.items() for field in ranges])
def test_both_ends_of_a_range_are_taken_and_nothing_beyond(algorithm, field):
    low, high = RANGES[algorithm][field]
    others = TOGETHER.get(field, {}) if algorithm not in (Ppo, A2c) else {}
    for value in (low, high):
        assert getattr(algorithm(**{field: value, **others}), field) == value
    for value in (beyond(low, -1.0), beyond(high, 1.0)):
        with pytest.raises(ValueError, match=f"{field} must be in"):
            algorithm(**{field: value, **others})
