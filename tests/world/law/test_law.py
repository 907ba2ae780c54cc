"""The law's rules by hand."""

import math

import pytest

from warp_torchrl.world.law.fire import Fire
from warp_torchrl.world.law.hazard import HazardFire
from warp_torchrl.world.law.law import growth_probability, in_finer_time, lightning_probability


def test_two_ticks_come_to_one():
    assert in_finer_time(0.75, 2) == pytest.approx(0.5)
    assert in_finer_time(0.3, 1) == 0.3 and in_finer_time(0.0, 8) == 0.0 and in_finer_time(1.0, 8) == 1.0
    rules = {"growth": True, "tau": 2.0, "beta": 0.5}
    for table in (Fire.growing, lambda fire: fire.lightning(4)):
        whole, finer = table(Fire(**rules)), table(HazardFire(**rules, refinement=8))
        assert [1.0 - (1.0 - chance) ** 8 for chance in finer] == pytest.approx(list(whole)) and any(whole)


def test_the_oldest_do_not_grow_and_the_youngest_grow_most():
    assert growth_probability(1, 5.0) == pytest.approx(math.exp(-0.5))
    assert growth_probability(9, 5.0) == pytest.approx(math.exp(-4.5))
    assert [growth_probability(code, 5.0) for code in (0, 10, 11, 15)] == [0.0] * 4
    assert growth_probability(3, 5.0, oldest=4) == pytest.approx(math.exp(-15 / 4))
    assert growth_probability(4, 5.0, oldest=4) == 0.0


def test_lightning_lights_the_oldest_most_and_no_fire():
    assert lightning_probability(10, 2.0, 100) == pytest.approx(0.02)
    assert lightning_probability(9, 2.0, 100) == pytest.approx(0.02 / math.e)
    assert [lightning_probability(code, 2.0, 100) for code in (0, 11, 15)] == [0.0] * 3
    assert lightning_probability(10, 1e6, 4) == 1.0
    assert lightning_probability(4, 2.0, 100, oldest=4) == pytest.approx(0.02)
    assert lightning_probability(3, 2.0, 100, oldest=4) == pytest.approx(0.02 * math.exp(-2.5))
