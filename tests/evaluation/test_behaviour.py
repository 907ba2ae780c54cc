"""The numbers of behaviour, by hand."""

import math

import numpy as np
import pytest
import torch

from tests.env.reward.drawing import CLEAR, EXTINGUISH, STAY, drawn
from warp_torchrl.evaluation.behaviour import Behaviour, division_of_labour, mutual_information
from warp_torchrl.world.backends.tick import in_wind
from warp_torchrl.world.law.fire import Fire
from warp_torchrl.world.state.cells import is_burning


def test_mutual_information_by_hand():
    # Each agent has a sector of its own: 1 bit for two. Independent: none. A half-way table: 0.75 / 0.25.
    own, same = np.array([[5.0, 0.0], [0.0, 5.0]]), np.array([[2.0, 2.0], [3.0, 3.0]])
    assert mutual_information(own) == pytest.approx(1.0)
    assert mutual_information(same) == pytest.approx(0.0)
    mixed = 1.0 + 0.75 * math.log2(0.75) + 0.25 * math.log2(0.25)  # 1 - H(0.25)
    assert mutual_information(np.array([[3.0, 1.0], [1.0, 3.0]])) == pytest.approx(mixed)
    assert mutual_information(np.zeros((2, 2))) == 0.0


def test_division_is_what_chance_does_not_explain():
    # 200 tables of two agents with eight acts each at random in eight sectors: chance alone gives 0.35 bits and more;
    # less their shuffled like, nothing is left: the mean of 200 has a standard error below 0.01. False alarm 1e-6.
    random = np.random.default_rng(0)
    tables = random.multinomial(8, np.full(8, 1 / 8), size=(200, 2)).astype(float)
    assert mutual_information(tables).mean() > 0.3
    assert abs(division_of_labour(tables).mean()) < 0.05
    own = np.zeros((1, 2, 8))
    own[0, 0, 0] = own[0, 1, 4] = 20.0
    assert division_of_labour(own)[0] == pytest.approx(1.0, abs=0.06)
    assert np.isnan(division_of_labour(np.zeros((1, 2, 8)))[0])


def test_acts_downwind_attack_the_head_and_shared_targets_are_contested():
    # Fires in the west and the east of a centre between them; the wind blows east.
    state, world = drawn(["TTTTTTT", "TFTTTFT", "TTTTTTT", "TTTTTTT"], [[0, 6], [0, 6], [0, 0]])
    state = in_wind(state, world.fire, torch.tensor([4.0, 0.0])[None, :, None, None])
    watched = Behaviour(state)
    watched(world.step(state, torch.tensor([[EXTINGUISH, EXTINGUISH, STAY]])))
    found = watched.summary()
    assert found["head_attack"][0] == pytest.approx(1.0)
    assert found["contested"][0] == 1.0
    both = Behaviour(state)
    both(world.step(state, torch.tensor([[EXTINGUISH, STAY, EXTINGUISH]])))
    assert both.summary()["head_attack"][0] == pytest.approx(0.0, abs=1e-6)
    assert both.summary()["contested"][0] == 0.0
    assert np.isnan(watched.summary()["lead_time"][0])


def test_lead_time_is_from_a_clearing_until_fire_stands_beside_it():
    # Fire in column 0 goes east, a column a step; the trees in columns 3 and 9 are cleared in the first step. It stands
    # beside column 3 when column 2 burns, after the step that began at 1: one step later. Column 9 is never reached,
    # since the world is one row and the break in column 3 holds. The episode is in its fourth step when it begins.
    certain = Fire(alpha=(0, 0, 0, 1.0, 0), diagonal="unit", wind_gain=0.0, wind_focus=0.0)
    state, world = drawn(["FTTTTTTTTTTT"] + ["~" * 12] * 3, [[0, 3], [0, 9]], steps_per_tick=1, fire=certain)
    state = state.replace(step=state.step + 3)
    watched = Behaviour(state)
    for action in ([CLEAR, CLEAR], [STAY, STAY], [STAY, STAY]):
        transition = world.step(state, torch.tensor([action]))
        watched(transition)
        state = transition.after
    assert is_burning(state.cells)[0, 0].nonzero().flatten().tolist() == [0, 1, 2]
    assert watched.summary()["lead_time"][0] == 1.0
    assert watched.summary()["unused_breaks"][0] == 0.5


def test_containment_counts_what_the_team_made():
    state, world = drawn(["TTTTT", "TTTTT", "TTFTT", "TTTTT", "TTTTT"], [[2, 2]])
    ring = torch.zeros(1, 5, 5, dtype=torch.bool)
    ring[:, 1:4, 1:4] = True
    ring[:, 2, 2] = False
    watched = Behaviour(state)
    watched(world.step(state.replace(firebreak=ring), torch.tensor([[STAY]])))
    assert watched.summary()["containment"][0] == 1.0
    assert Behaviour(state).summary()["containment"][0] == 0.0
