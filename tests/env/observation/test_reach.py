"""What the critic is told of where fire and team can be."""

import math

import pytest
import torch

from tests.conftest import small_world
from tests.env.observation.test_observation import drawn, judged
from warp_torchrl.env import WildfireEnv
from warp_torchrl.env.observation import CriticState, Local

REACHING = Local(radius=2, reach=True)


def planes(state, world) -> dict[str, torch.Tensor]:
    return judged(state, world, REACHING.choice)


def test_it_tells_how_soon_fire_can_be_where_and_that_a_closed_ring_holds_it() -> None:
    cells = torch.full((16, 16), 5)
    cells[4, 6] = 11
    state, world = drawn(cells.tolist(), [[0, 0]])
    seen = planes(state, world)["fire_reach"]  # blocks of one cell
    assert seen[4, 6] == 0.0 and seen[5, 7] == pytest.approx(math.exp(-1 / 2))
    assert seen[4, 15] == pytest.approx(math.exp(-9 / 2))
    cells[2:7, [4, 8]] = 0
    cells[[2, 6], 4:9] = 0
    state, world = drawn(cells.tolist(), [[0, 0]])
    assert planes(state, world)["fire_reach"].count_nonzero() == 8
    cells[2, 4] = 5
    state, world = drawn(cells.tolist(), [[0, 0]])
    assert planes(state, world)["fire_reach"].count_nonzero() > 200, "the ring lacks a cell"


def test_a_block_holds_the_mean_of_its_cells() -> None:
    cells = torch.full((32, 32), 5)
    cells[0, 0] = 11
    state, world = drawn(cells.tolist(), [[0, 0]])
    assert planes(state, world)["fire_reach"][0, 0] == pytest.approx(0.75 * math.exp(-1 / 4))


def test_it_tells_how_soon_the_team_can_be_where() -> None:
    state, world = drawn([[5] * 16] * 16, [[8, 8], [0, 15]])
    seen = planes(state, world)["team_reach"]
    assert seen[8, 8] == seen[0, 15] == 1.0
    assert seen[8, 12] == seen[12, 9] == pytest.approx(math.exp(-4 / 2))
    assert seen[0, 13] == pytest.approx(math.exp(-2 / 2))


def test_an_environment_shows_it_where_it_is_asked_for() -> None:
    env = WildfireEnv(small_world(), n_worlds=2, seed=0, observation=REACHING)
    plain = CriticState(small_world()).names
    assert env.state_names == (*plain[:-1], "fire_reach", "team_reach", plain[-1])
    out = env.rollout(4)
    assert out["state"].shape[2:] == env.observation_spec["state"].shape[1:]
    assert env.state_symmetry.channels == len(env.state_content) == len(env.state_names)
    assert "fire_reach" not in WildfireEnv(small_world(), n_worlds=2, seed=0).state_names


def test_a_step_with_it_is_neither_recorded_nor_compiled() -> None:
    with pytest.raises(ValueError, match=r"graph must be false with observation\.reach"):
        WildfireEnv(small_world(), n_worlds=2, seed=0, observation=REACHING, graph=True)
    env = WildfireEnv(n_worlds=256, observation=REACHING, fuse=True)
    assert env.why_eager == "a step with reach is not compiled"
