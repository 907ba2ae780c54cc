"""Chances of growth and of lightning by hand, and in finer time."""

import math

import pytest

from warp_torchrl.world.rates import growth, in_a_tick, spontaneous_ignition


def test_two_ticks_come_to_one():
    assert in_a_tick(0.75, 2) == pytest.approx(0.5)
    assert in_a_tick(0.3, 1) == 0.3 and in_a_tick(0.0, 8) == 0.0 and in_a_tick(1.0, 8) == 1.0
    for table in (lambda ticks: growth(2.0, ticks), lambda ticks: spontaneous_ignition(0.5, 4, ticks)):
        whole, finer = table(1), table(8)
        assert [1.0 - (1.0 - chance) ** 8 for chance in finer] == pytest.approx(list(whole))


def test_the_oldest_do_not_grow_and_the_youngest_grow_most():
    table = growth(5.0, 1)
    assert len(table) == 16 and table[1] == pytest.approx(math.exp(-0.5)) and table[9] == pytest.approx(math.exp(-4.5))
    assert table[0] == 0.0 and not any(table[10:])


def test_lightning_lights_the_oldest_most_and_no_fire():
    table = spontaneous_ignition(2.0, 100, 1)
    assert table[10] == pytest.approx(0.02) and table[9] == pytest.approx(0.02 / math.e)
    assert table[0] == 0.0 and not any(table[11:])
    assert spontaneous_ignition(1e6, 4, 1)[10] == 1.0
