"""The fire alone: the environment's fire without its team, and what is read off a history."""

import pytest
import torch

from tests.world.drawing import draw, drawn, tiled
from warp_torchrl.world.air.wind import Paper, Uniform, Wandering, Wind
from warp_torchrl.world.arrays.random import world_key
from warp_torchrl.world.backends.tick import advance
from warp_torchrl.world.fires.burn import FireHistory, burn, start_burning, trace
from warp_torchrl.world.ignition.ignition import Ignition
from warp_torchrl.world.law.fire import Fire
from warp_torchrl.world.law.hazard import HazardFire
from warp_torchrl.world.state.state import WorldState
from warp_torchrl.world.team.team import Team
from warp_torchrl.world.terrain.landscape import Perlin
from warp_torchrl.world.world import World

FIRES = {
    "paper": Fire(growth=True, beta=0.65, p_regrow=0.01),
    "hazard": HazardFire(kernel="ellipse", refinement=3),
}
WINDS = {"steady": Uniform(speed=5.0), "field": Paper(scale=0.5), "wandering": Wandering(speed=6.0)}


def fire_alone(state: WorldState, fire: Fire, wind: Wind, *, first_tick: int = 0, seed: int = 0) -> WorldState:
    return start_burning(
        state.landscape.replace(age=state.cells),
        wind=wind,
        fire=fire,
        first_tick=first_tick,
        stage_age=state.stage_age,
        seed=seed,
        cell_size=30.0,
    )


@pytest.mark.parametrize("wind", WINDS)
@pytest.mark.parametrize("fire", FIRES)
def test_the_fire_alone_is_the_fire_of_the_world(fire: str, wind: str) -> None:
    # It draws world i with seed + i from ``first_tick`` on, so it goes on just as the world's own does.
    world = World(
        landscape=Perlin(size=14, relief=60.0),
        wind=WINDS[wind],
        fire=FIRES[fire],
        ignition=Ignition(head_start=2),
        team=Team(n_agents=1),
    )
    seeds = torch.arange(5, 9)
    state = world.reset(seeds, torch.zeros_like(seeds))
    alone = fire_alone(state, world.fire, world.wind, first_tick=2, seed=5)
    assert torch.equal(alone.wind, state.wind)
    after = state
    for _ in range(6):
        after = advance(after, world.fire, world.wind, torch.ones(4, dtype=torch.bool))
    assert torch.equal(burn(alone, world.fire, world.wind, 6).cells, after.cells)
    assert not torch.equal(after.cells, state.cells)


@pytest.mark.parametrize("wind", WINDS)
@pytest.mark.parametrize("fire", FIRES)
def test_a_history_cut_in_two_is_the_whole(fire: str, wind: str) -> None:
    law, air = FIRES[fire], WINDS[wind]
    start = draw(tiled("TTTTT", 9, 3), fire=law, worlds=3)
    start.cells[:, 4, 7] = 11
    whole = trace(fire_alone(start, law, air), law, air, 9, 30.0)
    half = trace(fire_alone(start, law, air), law, air, 4, 30.0)
    rest = start.replace(cells=half.cells, stage_age=half.stage_age)
    rest = trace(fire_alone(rest, law, air, first_tick=4), law, air, 5, 30.0)
    assert torch.equal(rest.cells, whole.cells)
    assert torch.equal(torch.cat((half.alight, rest.alight[:, 1:]), dim=1), whole.alight)


def test_a_certain_fire_arrives_with_its_distance() -> None:
    # alpha 1, calm, flat, unit diagonal: one cell a tick all round; a cell is 1 ha, and (2 t + 1)^2 have caught fire.
    fire = Fire(diagonal="unit")
    history = trace(draw("TTTTT TTTTT TTaTT TTTTT TTTTT", fire=fire), fire, Uniform(), 3, 100.0)
    assert history.arrival[0].tolist() == [
        [2, 2, 2, 2, 2],
        [2, 1, 1, 1, 2],
        [2, 1, 0, 1, 2],
        [2, 1, 1, 1, 2],
        [2, 2, 2, 2, 2],
    ]
    assert history.burned_area().tolist() == [[1.0, 9.0, 25.0, 25.0]]
    assert history.alight.tolist() == [[1, 9, 25, 25]]
    assert drawn(draw("T").replace(cells=history.cells)) == "bbbbb bcccb bcdcb bcccb bbbbb"


def test_what_never_burned_never_was_reached() -> None:
    # Fire in the west of one world of two; a lake between, so the east never burns.
    fire = Fire(diagonal="unit")
    both = draw("T~T", worlds=2, fire=fire)
    both.cells[1, 0, 0] = 11
    history = trace(both, fire, Uniform(), 6, 30.0)
    assert history.arrival.tolist() == [[[-1, -1, -1]], [[0, -1, -1]]]
    assert history.burn_probability().tolist() == [[0.5, 0.0, 0.0]]
    assert history.mean_arrival()[0, 0] == 0.0
    assert history.mean_arrival()[0, 1:].isnan().all()
    assert history.burned_area()[0].tolist() == [0.0] * 7


def test_ground_that_burns_twice_arrived_once() -> None:
    fire = Fire(p_regrow=1.0, youngest_fuel=1, beta=1e6)
    history = trace(draw(".."), fire, Uniform(), 20, 30.0)
    assert history.arrival[0].tolist() == [[2, 2]]  # grows at the first tick, lightning at the second
    # Alight for five ticks, ash, grown, alight again: ticks 2..6, 9..13, 16..20.
    assert history.alight[0].tolist() == [0, 0, *[2] * 5, 0, 0, *[2] * 5, 0, 0, *[2] * 5]
    assert history.burned_area()[0].tolist() == pytest.approx([0.0, 0.0, *[0.18] * 19])


def test_burn_probabilities_are_shares_of_the_worlds() -> None:
    # Wetland, four stages at 0.1 each: 1 - 0.9^4 = 0.3439. 5000 worlds, standard error 0.00672, five: 6e-7.
    history = trace(draw("aT", ground="ww", worlds=5000), Fire(), Uniform(speed=0.0), 5, 30.0)
    probability = history.burn_probability()
    assert probability[0, 0] == 1.0
    assert probability[0, 1].item() == pytest.approx(0.3439, abs=5 * 0.00672)
    # Mean arrival of those that burned: sum t 0.9^(t-1) 0.1 / 0.3439 over t = 1..4 = 2.3687; deviation 1.11 over 1720.
    assert history.mean_arrival()[0, 1].item() == pytest.approx(2.3687, abs=5 * 0.0268)


def test_a_history_is_a_batch_of_worlds() -> None:
    history = trace(draw("aTT", worlds=5), Fire(), Uniform(), 2, 30.0)
    assert isinstance(history, FireHistory) and history.batch_size == (5,)
    assert history[2:].arrival.shape == (3, 1, 3)
    assert history[2:].burned_area().shape == (3, 3)


def test_one_number_is_an_episode_of_all_seeds() -> None:
    seeds = torch.arange(4)
    assert torch.equal(world_key(seeds, 3), world_key(seeds, torch.full_like(seeds, 3)))
    assert torch.equal(world_key(seeds), world_key(seeds, torch.zeros_like(seeds)))
