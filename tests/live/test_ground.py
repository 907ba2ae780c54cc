"""The ground in three dimensions, on a map that is drawn by hand."""

import math
import tracemalloc

import numpy as np
import pytest

from tests.world.drawing import draw
from warp_torchrl.live.ground import cell_at, ground_of

MAP = """
    15T.
    ~acT
    T#e1
"""
HEIGHT, WIDTH = 3, 4
SLOPE = [[30.0 * column for column in range(WIDTH)]] * HEIGHT  # 45 degrees up to the east, of cells of 30 m


def test_the_middle_of_the_map_is_the_origin_east_is_x_and_north_is_y():
    # Four columns stand at -1.5, -0.5, 0.5, 1.5; three rows at 1, 0, -1.
    ground = ground_of(draw(MAP))
    assert ground.position[0].tolist() == [-1.5, 1.0, 0.0] and ground.position[-1].tolist() == [1.5, -1.0, 0.0]
    assert np.allclose(ground.turn, [1.0, 0.0, 0.0, 0.0])


def test_heights_are_over_the_mean_in_cells_and_twice_as_large():
    ground = ground_of(draw(MAP, elevation=SLOPE))
    # Columns are 45 m below to 45 m above the mean: -1.5 to 1.5 cells, twice that; corners at the edge repeat it.
    assert np.allclose(ground.height[1, 1:3], [-1.0, 1.0])


def test_tiles_lie_on_the_slope():
    ground = ground_of(draw(MAP, elevation=SLOPE))
    w, x, y, z = ground.turn[5]
    normal = [2 * (x * z + w * y), 2 * (y * z - w * x), 1 - 2 * (x * x + y * y)]
    # Up two cells for one to the east: the normal is (-2, 0, 1) / sqrt 5.
    assert np.allclose(normal, [-2 / math.sqrt(5), 0.0, 1 / math.sqrt(5)], atol=1e-6)


def test_tiles_lie_on_a_slope_that_rises_to_the_south():
    south = [[30.0 * row] * WIDTH for row in range(HEIGHT)]
    w, x, y, z = ground_of(draw(MAP, elevation=south)).turn[5]
    normal = [2 * (x * z + w * y), 2 * (y * z - w * x), 1 - 2 * (x * x + y * y)]
    assert np.allclose(normal, [0.0, 2 / math.sqrt(5), 1 / math.sqrt(5)], atol=1e-6), "it looks to the north"


def test_the_block_is_closed():
    faces = ground_of(draw(MAP, elevation=SLOPE)).block.faces
    edges = {tuple(edge) for edge in faces[:, [0, 1, 1, 2, 2, 0]].reshape(-1, 2).tolist()}
    assert len(edges) == 3 * len(faces) and all((end, start) in edges for start, end in edges)


@pytest.mark.parametrize("cell", [(0, 0), (2, 3), (1, 2)])
def test_a_ray_meets_the_cell_that_it_was_aimed_at(cell):
    ground = ground_of(draw(MAP, elevation=SLOPE))
    target = ground.position[cell[0] * WIDTH + cell[1]].astype(float)
    origin = target + np.array([-3.0, -6.0, 12.0])
    direction = (target - origin) / np.linalg.norm(target - origin)
    assert cell_at(tuple(origin), tuple(direction), ground) == cell


def test_a_ray_into_the_sky_or_beside_the_map_meets_nothing():
    ground = ground_of(draw(MAP))
    assert cell_at((0.0, 0.0, 5.0), (0.0, 0.0, 1.0), ground) is None
    assert cell_at((50.0, 0.0, 5.0), (0.0, 0.0, -1.0), ground) is None


@pytest.mark.parametrize("far", [1e3, 1e9])
def test_a_ray_from_afar_takes_no_more_steps_than_one_from_near(far):
    ground = ground_of(draw(MAP, elevation=SLOPE))
    tracemalloc.start()
    assert cell_at((0.5, 0.5, far), (0.0, 0.0, -1.0), ground) is not None
    assert tracemalloc.get_traced_memory()[1] < 1e6
    tracemalloc.stop()


@pytest.mark.parametrize("direction", [(0.0, 0.0, 0.0), (0.0, 0.0, -1e9), (math.nan, 0.0, -1.0), (1.0, 1.0, -1.0)])
def test_what_is_no_direction_meets_nothing(direction):
    assert cell_at((0.0, 0.0, 0.5), direction, ground_of(draw(MAP))) is None
