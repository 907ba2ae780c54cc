"""Meshes that are drawn are closed, and their outside is outside."""

from collections import Counter

import numpy as np
import pytest

from warp_torchrl.live import shapes

SHAPES = {
    "tree": shapes.tree(),
    "flame": shapes.flame(),
    "puff": shapes.puff(),
    "house": shapes.house(),
    **{f"bulldozer {part}": shape for part, shape in shapes.bulldozer().items()},
    **{f"drone {part}": shape for part, shape in shapes.drone().items()},
}


@pytest.mark.parametrize("name", SHAPES)
def test_every_edge_is_of_two_faces_that_go_along_it_in_opposite_ways(name):
    faces = SHAPES[name].faces
    edges = Counter(tuple(edge) for edge in faces[:, [0, 1, 1, 2, 2, 0]].reshape(-1, 2).tolist())
    assert set(edges.values()) == {1} and all((end, start) in edges for start, end in edges)


@pytest.mark.parametrize("name", SHAPES)
def test_faces_look_outwards(name):
    # The divergence theorem: a closed mesh whose faces look outwards has a positive volume.
    assert volume(SHAPES[name]) > 0.0


def volume(shape):
    a, b, c = (shape.vertices[shape.faces[:, corner]].astype(float) for corner in range(3))
    return float((a * np.cross(b, c)).sum() / 6.0)


def test_a_box_has_the_volume_of_its_sides():
    assert volume(shapes.box((2.0, 3.0, 0.5), (7.0, -1.0, 4.0))) == pytest.approx(3.0)


def test_a_tree_is_one_high_and_stands_in_its_cell():
    low, high = shapes.tree().vertices.min(axis=0), shapes.tree().vertices.max(axis=0)
    assert high[2] == 1.0 and low[2] >= 0.0 and max(-low[0], high[0], -low[1], high[1]) <= 0.5


def test_shapes_that_are_joined_keep_their_volumes():
    one, other = shapes.box((1, 1, 1), (0, 0, 0)), shapes.box((1, 2, 1), (5, 0, 0))
    assert volume(shapes.joined_meshes(one, other)) == pytest.approx(3.0)
