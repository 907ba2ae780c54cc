"""Law ``lattice`` by hand, and its chances as they come out.

Seeds are fixed, so a frequency passes or fails for good; a bound of 4.9 deviations would fail for one seed in a
million.
"""

import math

import pytest
import torch

from tests.world.drawing import differing, draw, drawn
from warp_torchrl.world.arrays.random import Stream, uniform
from warp_torchrl.world.law.lattice import LatticeFire

ALPHA, BETA, DELTA = 0.2763, math.exp(-0.1), 0.15 / 0.2763
LAW, MANY = LatticeFire(), 20_000


def ticked(state, law=LAW, ticks=1, now=True):
    for _ in range(ticks):
        u = uniform(state.key, state.tick, Stream.FIRE, tuple(state.cells.shape[1:]))
        state = law.tick(state, u, torch.full_like(state.key, now, dtype=torch.bool))
    return state


def is_close(count, p):
    return abs(count - MANY * p) < 4.9 * math.sqrt(MANY * p * (1.0 - p))


@pytest.mark.parametrize(
    ("drawing", "k"),
    [
        ("TTT TTT TTT", 0),
        ("TaT TTT TTT", 1),
        ("TaT aTT TTT", 2),
        ("TaT aTa TTT", 3),
        ("TaT aTa TaT", 4),
        ("aTa TTT aTa", 0),
    ],
)
def test_a_tree_with_k_burning_neighbours_of_four_ignites_by_1_minus_the_chance_that_each_spares_it(drawing, k):
    state = draw(drawing, fire=LAW)
    assert LAW.ignition_probability(state)[0, 1, 1].item() == pytest.approx(1.0 - (1.0 - ALPHA) ** k, abs=1e-6)


def test_lightning_joins_the_chance_of_neighbours():
    # Trees of age 10 on nine cells: 0.9 / 9 = 0.1 by themselves.
    law = LatticeFire(beta=0.9)
    chance = law.ignition_probability(draw("TaT TTT TTT", fire=law))[0]
    assert chance[1, 1].item() == pytest.approx(0.1 + 0.9 * ALPHA) and chance[2, 0].item() == pytest.approx(0.1)


@pytest.mark.parametrize(("drawing", "k"), [("TaT TTT TTT", 1), ("TaT aTa TTT", 3)])
def test_trees_ignite_as_often_as_that(drawing, k):
    after = ticked(draw(drawing, fire=LAW, worlds=MANY))
    assert is_close((after.cells[:, 1, 1] == 11).sum().item(), 1.0 - (1.0 - ALPHA) ** k)
    assert not after.burned[:, 1, 1].any()


@pytest.mark.parametrize(("treated", "p"), [(0, 1.0 - BETA), (1, 1.0 - BETA + DELTA)])
def test_fires_burn_out_as_often_as_they_should_with_retardant_and_without(treated, p):
    state = draw("a.", fire=LAW, worlds=MANY)
    state = state.replace(wet=torch.full_like(state.wet, treated))
    assert LAW.burn_out_probability(state)[0].tolist() == [[pytest.approx(p), 0.0]]
    after = ticked(state)
    out = after.cells[:, 0, 0] == 0
    assert is_close(out.sum().item(), p) and torch.equal(after.burned[:, 0, 0], out)
    assert (after.cells[:, 0, 0][~out] == 11).all() and (after.age[:, 0, 0] == 10 * ~out).all()
    assert (after.wet == 0).all(), "retardant acts on one tick"


def test_fires_forget_for_how_long_they_have_burned():
    after = ticked(draw("a", fire=LAW, worlds=MANY), ticks=8)
    assert is_close((after.cells == 11).sum().item(), BETA**8)


def test_expected_ignitions_are_alpha_for_each_healthy_neighbour_of_four():
    expected = LAW.expected_ignitions(draw("TTT TaT T.a", fire=LAW))
    assert expected[0].tolist() == [[0.0] * 3, [0.0, pytest.approx(3 * ALPHA), 0.0], [0.0, 0.0, pytest.approx(ALPHA)]]


def test_worlds_that_do_not_tick_stay_as_they_are():
    state = draw("TaT aTa TaT", fire=LAW, worlds=50)
    assert not differing(ticked(state, now=False), state)
    assert differing(ticked(state), state)


def test_nothing_burns_for_ever_and_what_is_burnt_stays_so():
    state = draw(" ".join(["T" * 9] * 4 + ["TTTTaTTTT"] + ["T" * 9] * 4), fire=LAW, worlds=8)
    for _ in range(200):
        after = ticked(state)
        assert (after.burned | ~state.burned).all() and (after.cells[state.burned] == 0).all()
        state = after
    assert not (state.cells > 10).any() and state.burned.any()


def test_trees_grow_and_lightning_strikes_where_they_are_asked_to():
    law = LatticeFire(growth=True, tau=0.0, beta=9.0)
    state = draw("3T", fire=law)
    assert law.ignition_probability(state)[0, 0, 1].item() == pytest.approx(1.0), "9 exp(0) / 2, cut to 1"
    assert drawn(ticked(draw("3", fire=law), LatticeFire(growth=True, tau=0.0))) == "4"


def test_numbers_out_of_range_are_refused():
    with pytest.raises(ValueError, match=r"retardant must be in \[0, 0.5\], got 0.6"):
        LatticeFire(persistence=0.5, retardant=0.6)
    with pytest.raises(ValueError, match=r"burning_stages must be in \[1, 1\], got 2"):
        LatticeFire(burning_stages=2)
    with pytest.raises(ValueError, match="alpha must be in"):
        LatticeFire(alpha=1.5)
