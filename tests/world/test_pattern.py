"""Chances from the table are those of the sum over directions, to the bit."""

import pytest
import torch

from warp_torchrl.world.fire import Fire
from warp_torchrl.world.hazard import HazardFire
from warp_torchrl.world.landscape import Perlin
from warp_torchrl.world.law import Clipped
from warp_torchrl.world.pattern import BESIDE, bit_of, burning_neighbours, pattern_table
from warp_torchrl.world.spread import gains, ignition_chance
from warp_torchrl.world.state import is_burning
from warp_torchrl.world.wind import Uniform, Wandering
from warp_torchrl.world.world import World

from .drawing import draw

N, NE, E, SE, S, SW, W, NW = (1 << bit_of(direction) for direction in range(8))


def test_a_bit_stands_for_each_direction_that_fire_comes_in() -> None:
    # A fire in the middle travels north into the cell above it, north-east into the next, and so on clockwise.
    spreading = is_burning(draw("... .a. ...").cells)
    assert burning_neighbours(spreading)[0].tolist() == [[NW, N, NE], [W, 0, E], [SW, S, SE]]
    assert sorted((N, E, S, W, NE, SE, SW, NW)) == [1 << bit for bit in range(8)] and N | E | S | W == BESIDE


def test_nothing_comes_from_beyond_the_border_or_from_another_world() -> None:
    spreading = is_burning(draw("a.. ... ..a", worlds=2).cells)
    spreading[1] = False
    assert burning_neighbours(spreading)[0, 0].tolist() == [0, E, 0]
    assert not burning_neighbours(spreading)[1].any()


def test_a_table_by_hand() -> None:
    # Alpha 0.5, calm: 0.5 from the south (north-going), 0.5 / sqrt 2 = 0.3536 on the diagonal; both 1 - 0.5 x 0.6464.
    table = pattern_table(Clipped(), torch.tensor([0.5]), gains(torch.ones(1, 8, 1, 1), "distance"))
    assert table.shape == (1, 2, 256) and not table[0, 0].any()
    wanted = torch.tensor([0.0, 0.5, 0.35355339, 1.0 - 0.5 * 0.64644661])
    torch.testing.assert_close(table[0, 1, [0, N, NE, N | NE]], wanted)


LAWS = [
    Fire(),
    Fire(burning_stages=5, neighbours=4, wind_gain=0.3),  # gains over 1 / alpha, which are clipped
    Fire(kernel="ellipse", diagonal="unit", alpha=(0.3, 0.1, 1.0, 0.8, 0.2)),
    HazardFire(refinement=2),
]


@pytest.mark.parametrize("wind", [Uniform(speed=7.0), Wandering()])
@pytest.mark.parametrize("fire", LAWS)
def test_both_ways_agree_to_the_bit(fire: Fire, wind: Uniform | Wandering) -> None:
    world = World(landscape=Perlin(size=24), fire=fire, wind=wind, steps_per_tick=1)
    state = world.reset(torch.arange(4), torch.zeros(4, dtype=torch.int64))
    stay = torch.full((4, world.team.n_agents), 10)
    compared = 0
    for _ in range(12):
        spreading = is_burning(state.cells) & (state.cells <= fire.last_spreading)
        susceptible = fire._law().susceptibility(state.alpha) * fire.is_fuel(state)
        gain = gains(fire.wind_factor(state.wind), fire.diagonal)
        assert state.chances is not None
        wanted = ignition_chance(fire._law(), spreading, susceptible, gain, None, fire.neighbours)
        assert torch.equal(fire.spread(state), wanted)
        compared += int((wanted > 0.0).sum())
        state = world.step(state, stay).after
    assert compared > 300
