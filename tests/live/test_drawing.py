"""The arrays of the picture in three dimensions, on a map that is drawn by hand."""

import math

import numpy as np
import pytest
import torch

from tests.world.drawing import draw
from warp_torchrl.env.pictures.colours import HOUSE, LOST, fire_colours
from warp_torchrl.env.pictures.render import ground_colours
from warp_torchrl.live import drawing
from warp_torchrl.live.ground import ground_of
from warp_torchrl.live.match import Match, Setting
from warp_torchrl.world.state.state import Action

MAP = """
    15T.
    ~acT
    T#e1
"""


def test_tiles_have_the_colours_of_the_map_darker_under_trees():
    state = draw(MAP)
    cells = ground_colours(state)[0]
    colours, painted = drawing.tiles(state, ground_of(state), cells), cells.flatten(0, 1).numpy()
    bare_and_burning = [3, 4, 5, 6, 9, 10]
    assert (colours[bare_and_burning] == painted[bare_and_burning]).all()
    assert (colours[1] < painted[1]).all()


def test_every_tree_is_as_tall_as_it_is_old_and_where_none_is_it_has_no_size():
    state = draw(MAP)
    ground = ground_of(state)
    assert ground.trees.tolist() == [0, 1, 2, 3, 5, 6, 7, 8, 9, 10, 11], "all but the lake"
    shown = drawing.trees(state, ground, ground_colours(state)[0])
    tall = dict(zip(ground.trees.tolist(), shown.scale[:, 2].tolist()))
    assert tall[3] == tall[9] == 0.0, "bare ground and a firebreak"
    # 0.45 + 0.1 age, within 15 % of it; a tree that burns is as tall as it was, 10 years.
    for cell, height in {0: 0.55, 1: 0.95, 2: 1.45, 5: 1.45}.items():
        assert tall[cell] == pytest.approx(height, rel=0.151), cell


def test_a_flame_stands_on_each_cell_that_burns_in_the_colour_of_its_stage():
    state = draw(MAP)
    ground = ground_of(state)
    shown = drawing.flames(state, ground)
    assert shown.position.tolist() == ground.position[[5, 6, 10]].tolist()
    assert shown.colour.tolist() == fire_colours()[[0, 2, 4]].tolist()


def test_a_house_stands_where_something_does_lower_and_darker_the_less_is_left():
    ground = ground_of(draw("TTT TTT"))
    shown = drawing.houses(torch.tensor([[[-1.0, 1.0, -1.0], [0.0, -1.0, 0.5]]]), ground)
    assert shown.position.tolist() == ground.position[[1, 3, 5]].tolist()
    assert shown.colour[:2].tolist() == [list(HOUSE), list(LOST)]
    tall = shown.scale[:, 2] / shown.scale[:, 0]
    assert tall.tolist() == pytest.approx([1.0, 0.4, 0.7]) and (shown.scale[:, 0] == shown.scale[:, 1]).all()


def test_without_fire_there_is_neither_flame_nor_smoke_nor_glow():
    state = draw("5T. ~11")
    ground = ground_of(state)
    assert len(drawing.flames(state, ground).position) == len(drawing.smoke_puffs(state, ground).position) == 0
    assert drawing.glow(state, ground)[1] == 0.0


def test_the_glow_stands_over_the_densest_fire_and_grows_with_it():
    ground = ground_of(draw("TTTTTTTTTTTTTTTTTTTT"))
    few, more = draw("aTTTTTTTTTTTTTTTTabT"), draw("aTTTTTTTTTTTTTTTabcT")
    (x, y, z), strength = drawing.glow(few, ground)
    assert x == ground.position[17, 0] and (y, z) == (0.0, 4.0), "two cells burn there, and one at the other end"
    assert strength > 0.0 and drawing.glow(more, ground)[1] > strength


def test_smoke_goes_up_and_with_the_wind():
    state = draw("cccc cccc cccc", wind=(10.0, 0.0))
    ground = ground_of(state)
    shown = drawing.smoke_puffs(state, ground)
    index = [int(np.abs(ground.position[:, 1] - place[1]).argmin()) for place in shown.position]
    assert len(index) > 0 and (shown.position[:, 2] >= 2.0).all()
    # At a height of h cells the puff is 10 m/s x 0.12 h east of its cell, whose columns begin at -1.5.
    column = shown.position[:, 0] - 1.2 * (shown.position[:, 2] - 0.0)
    assert np.allclose(column, np.round(column - 0.5) + 0.5, atol=1e-4)


def test_sparks_rise_with_the_wind_from_each_burning_cell_and_darken():
    state = draw("Tc~ T#T", wind=(10.0, 0.0))  # one cell burns, at (0, 0.5)
    places, colours = drawing.sparks(state, ground_of(state))
    x, y, z = places.T
    assert len(places) == 3 and (z >= 0.6).all() and (z <= 5.0).all()
    # At a height of h cells a spark is 10 m/s x 0.12 h east of where it rose, within half a cell of the middle.
    assert (abs(x - 1.2 * z) <= 0.5).all() and (abs(y - 0.5) <= 0.5).all()
    assert colours[z.argmax()].sum() < colours[z.argmin()].sum()
    assert len(drawing.sparks(draw("5T. ~11"), ground_of(draw("5T. ~11")))[0]) == 0


def test_vehicles_stand_on_their_cells_aircraft_above_and_face_where_they_moved():
    state = draw(MAP, at=[(0, 1), (2, 3)])
    ground = ground_of(state)
    shown = drawing.vehicles(state, ground, torch.tensor([False, True]), torch.tensor([-1, int(Action.NORTH)]))
    assert np.allclose(shown.position, [[-0.5, 1.0, 0.05], [1.5, -1.0, 3.05]])
    # East, where none has moved yet, is no turn; north is a quarter: half of it is 45 degrees.
    assert np.allclose(shown.turn, [[1.0, 0, 0, 0], [math.sqrt(0.5), 0, 0, math.sqrt(0.5)]], atol=1e-6)
    assert len({tuple(colour) for colour in shown.colour.tolist()}) == 2


def test_a_heading_points_ahead_or_to_the_place_of_an_order():
    state = draw(MAP, at=[(0, 1), (2, 3)])
    ground = ground_of(state)
    shown = drawing.vehicles(state, ground, torch.tensor([False, False]), torch.tensor([int(Action.SOUTH)] * 2))
    lines = drawing.headings(shown, {1: (0, 0)}, ground)
    ahead = lines[0, 1] - lines[0, 0]
    assert ahead[1] < 0.0 and abs(ahead[0]) < 1e-6 and ahead[2] == 0.0
    assert np.allclose(lines[1, 1], ground.position[0] + (0.0, 0.0, 0.6))


def test_wind_arrows_point_where_the_air_goes_and_a_calm_has_none():
    plain = " ".join(["." * 25] * 25)
    state = draw(plain, wind=(0.0, 12.0))
    ground = ground_of(state)
    arrows = drawing.wind_arrows(state, ground)
    # 12 m/s north is as long as the distance of two arrows: 25 cells / 5.
    assert np.allclose(arrows[:, 1] - arrows[:, 0], [0.0, 5.0, 0.0], atol=1e-5)
    calm = drawing.wind_arrows(draw(plain), ground)
    assert (calm[:, 0] == calm[:, 1]).all()


def test_a_large_map_has_no_trees_of_its_own():
    match = Match(Setting(policy="noop", overrides=("landscape.size=130", "team.n_agents=2")))
    ground = ground_of(match.alone.state)
    assert len(ground.trees) == 0
    cells = ground_colours(match.alone.state)[0]
    assert (drawing.tiles(match.alone.state, ground, cells) == cells.flatten(0, 1).numpy()).all()
