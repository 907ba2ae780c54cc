"""The fire alone, as users call it."""

import pytest
import torch

from warp_torchrl import fire_history, make_env, simulate
from warp_torchrl.world.air.wind import Calm, Wandering
from warp_torchrl.world.arrays.random import Stream, uniform
from warp_torchrl.world.law.fire import Fire
from warp_torchrl.world.law.hazard import HazardFire


def forest(worlds=2, side=9):
    cells = torch.full((worlds, side, side), 5, dtype=torch.uint8)
    cells[:, side // 2, side // 2] = 11
    return cells, torch.full_like(cells, 3)


def test_simulate_is_the_environments_fire():
    env = make_env(
        "spread_skirmish", n_worlds=2, overrides=["team.n_agents=1", "steps_per_tick=1", "wind.direction=30.0"]
    )
    env.reset()
    state = env.world_state
    air = (4.0 * torch.cos(torch.tensor(30.0).deg2rad()), 4.0 * torch.sin(torch.tensor(30.0).deg2rad()))
    automaton = env.world.fire
    for _ in range(3):
        draws = uniform(state.key, state.tick, Stream.FIRE, tuple(state.cells.shape[1:]))
        state = automaton.tick(state, draws, torch.ones(2, dtype=torch.bool))
    start = env.world_state
    after = simulate(start.cells, start.landscape.cover, wind=air, fire="spread", ticks=3, first_tick=1, seed=0)
    assert (after == state.cells).all()


def test_simulate_goes_on_where_it_stopped_and_each_world_has_its_seed():
    cells, cover = forest(3)
    whole = simulate(cells, cover, fire="spread", ticks=6, seed=4)
    half = simulate(cells, cover, fire="spread", ticks=3, seed=4)
    assert (simulate(half, cover, fire="spread", ticks=3, first_tick=3, seed=4) == whole).all()
    assert (simulate(cells[:1], cover[:1], fire="spread", ticks=6, seed=6) == whole[2:]).all()


def test_simulate_of_the_paper_is_the_complete_automaton():
    cells = torch.zeros(4, 20, 20, dtype=torch.uint8)
    grown = simulate(cells, torch.full_like(cells, 3), ticks=20)
    assert (grown > 0).any(), "empty ground regrows"
    still = simulate(cells, torch.full_like(cells, 3), fire="spread", ticks=20)
    assert (still == 0).all()


def test_simulate_takes_components_and_elevation():
    cells, cover = forest(1)
    uphill = torch.arange(9.0).flip(0)[:, None].mul(30.0).expand(1, 9, 9)
    sure = Fire(alpha=(0.0, 0.0, 0.0, 0.03, 0.0), slope_gain=0.1)  # 45 degrees north: 0.03 x exp(4.5) > 1
    after = simulate(cells, cover, uphill, wind=Calm(), fire=sure)
    assert after[0, 3, 4] == 11 and after[0, 5, 4] == 5


@pytest.mark.parametrize(
    ("change", "message"),
    [
        ({"cells": torch.zeros(2, 9, 9)}, "cells must be uint8"),
        ({"cover": torch.full((2, 9, 9), 7, dtype=torch.uint8)}, "cover must hold codes 0..4, got 7"),
        ({"cover": torch.zeros(2, 9, 8, dtype=torch.uint8)}, "cover must have the shape"),
        ({"elevation": torch.zeros(2, 9, 8)}, "elevation must have the shape"),
        ({"elevation": torch.full((2, 9, 9), float("nan"))}, "elevation must be finite"),
        ({"ticks": -1}, "ticks must be"),
        ({"fire": "inferno"}, "inferno"),
        ({"wind": (100.0, 0.0)}, "speed must be"),
        ({"cell_size": 0.0}, "cell_size must be"),
        ({"cell_size": float("nan")}, "cell_size must be"),
        ({"stage_age": torch.zeros(2, 9, 8, dtype=torch.uint8)}, "stage_age must have the shape"),
        ({"stage_age": torch.full((2, 9, 9), 24, dtype=torch.uint8), "fire": "hazard"}, "stage_age must be under 24"),
        ({"stage_age": torch.ones(2, 9, 9, dtype=torch.uint8)}, "stage_age must be under 1 "),
    ],
)
def test_simulate_refuses_what_does_not_fit(change, message):
    cells, cover = forest()
    with pytest.raises(ValueError, match=message):
        simulate(**{"cells": cells, "cover": cover, **change})
    with pytest.raises(ValueError, match=message):
        fire_history(**{"cells": cells, "cover": cover, **change})


def test_a_history_ends_as_simulate_does():
    cells, cover = forest()
    options = {"wind": Wandering(), "fire": "hazard", "ticks": 20, "seed": 3}
    history = fire_history(cells, cover, **options)
    assert (history.cells == simulate(cells, cover, **options)).all()
    assert ((history.arrival >= 0) == (history.cells != 5)).all()


def test_simulate_goes_on_within_a_stage():
    cells, cover = forest()
    options = {"fire": HazardFire(refinement=5), "seed": 3}
    half = fire_history(cells, cover, ticks=7, **options)
    rest = simulate(half.cells, cover, ticks=6, first_tick=7, stage_age=half.stage_age, **options)
    assert (rest == simulate(cells, cover, ticks=13, **options)).all()


def test_many_fires_on_one_map_are_one_call():
    cells, cover = forest(1)
    history = fire_history(cells.expand(300, -1, -1), cover.expand(300, -1, -1), fire="spread", ticks=12)
    probability = history.burn_probability()
    assert probability[4, 4] == 1.0 and probability.min() > 0.9  # forest, calm, alpha 0.8
