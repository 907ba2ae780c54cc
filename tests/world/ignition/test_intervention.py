"""What people do to a world: cells that they light or clear, counted as those of the rules."""

import pytest
import torch

from tests.world.drawing import draw
from warp_torchrl.world.air.wind import Calm
from warp_torchrl.world.backends.tick import advance
from warp_torchrl.world.ignition.intervention import can_be_lit, cleared, ignited
from warp_torchrl.world.law.arrivals import arrivals_in
from warp_torchrl.world.law.fire import Fire
from warp_torchrl.world.law.hazard import HazardFire
from warp_torchrl.world.law.rate import RateFire
from warp_torchrl.world.state.cells import count_trees
from warp_torchrl.world.state.state import Landscape
from warp_torchrl.world.team.team import Team
from warp_torchrl.world.world import World

MAP = """
    51.
    ~aT
"""


def at(*cells, size=(2, 3)):
    where = torch.zeros(1, *size, dtype=torch.bool)
    for row, column in cells:
        where[:, row, column] = True
    return where


EVERYWHERE = torch.ones(1, 2, 3, dtype=torch.bool)


def test_only_old_dry_trees_can_be_lit():
    # 5 and T; not the tree of age 1 (A_min is 2), bare ground, lake or fire.
    state = draw(MAP)
    assert can_be_lit(state, Fire()).tolist() == [[[True, False, False], [False, False, True]]]
    wet = state.replace(wet=torch.full_like(state.wet, 3))
    assert not can_be_lit(wet, Fire()).any()


def test_a_lit_cell_burns_in_its_first_stage_and_remembers_its_age():
    state = ignited(draw(MAP), Fire(), EVERYWHERE)
    assert state.cells.tolist() == [[[11, 1, 0], [0, 11, 11]]]
    assert state.age.tolist() == [[[5, 0, 0], [0, 10, 10]]]


def test_a_world_that_had_ended_goes_on_where_a_cell_is_lit_and_nowhere_else():
    state = draw("55.", worlds=2)
    state = state.replace(terminated=torch.ones_like(state.terminated))
    where = torch.zeros(2, 1, 3, dtype=torch.bool)
    where[0, 0, 1] = where[1, 0, 2] = True
    assert ignited(state, Fire(), where).terminated.tolist() == [False, True]


def test_a_lit_cell_begins_its_stage_anew():
    law = HazardFire()
    state = draw(MAP, fire=law)
    state = state.replace(stage_age=torch.full_like(state.cells, 1))
    assert ignited(state, law, at((0, 0))).stage_age[0, 0].tolist() == [0, 1, 1]


def test_under_a_law_with_a_clock_the_fire_goes_on_from_a_lit_cell():
    cover = torch.full((9, 9), 3)
    world = World(landscape=_Forest(), wind=Calm(), fire=RateFire(), team=Team(n_agents=1))
    state = world.reset(torch.tensor([0]), torch.tensor([0]))
    assert state.cover[0].equal(cover.to(torch.uint8))
    for _ in range(5):
        state = advance(state, world.fire, world.air, torch.ones(1, dtype=torch.bool))
    far = torch.zeros(1, 9, 9, dtype=torch.bool)
    far[0, 0, 0] = True
    before, state = state, ignited(state, world.fire, far & can_be_lit(state, world.fire))
    # The fire reached the corner at the end of six ticks, one of them its head start; elsewhere nothing has changed.
    assert float(arrivals_in(state).minutes[0, 0, 0]) == pytest.approx(6 * world.fire.minutes)
    assert int(arrivals_in(state).origin[0, 0, 0]) == 0 and int(state.cells[0, 0, 0]) == 11
    assert arrivals_in(state).minutes[0, 1:].equal(arrivals_in(before).minutes[0, 1:])
    for _ in range(60):
        state = advance(state, world.fire, world.air, torch.ones(1, dtype=torch.bool))
    assert (state.cells[0, :2, :2] != 10).sum() > 1, "its neighbours caught fire"


class _Forest:
    size = 9
    cell_size = 30.0

    def __call__(self, key):
        cover = torch.full((len(key), 9, 9), 3, dtype=torch.uint8)
        return Landscape(cover, torch.full_like(cover, 10), None)


def test_clearing_makes_firebreaks_of_trees_that_do_not_burn():
    before = draw(MAP)
    after = cleared(before, EVERYWHERE)
    assert after.cells.tolist() == [[[0, 0, 0], [0, 11, 0]]]
    assert after.firebreak.tolist() == [[[True, True, False], [False, False, True]]]
    # Of the four trees, three are cleared and one burns.
    counts = count_trees(after)
    assert (int(counts.cleared), int(counts.burning), int(counts.preserved)) == (3, 1, 0)


def test_what_is_not_marked_stays():
    state = draw(MAP)
    for after in (ignited(state, Fire(), at((0, 2))), cleared(state, at((1, 0)))):
        for name, leaf in after.leaves().items():
            assert leaf.equal(state.leaves()[name]), name
