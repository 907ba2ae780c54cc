"""The cells that shapes mark: by their middles, and however narrow they are."""

import math

import numpy as np
import pytest

from tests.world.rasters import rasterio
from warp_torchrl.world.terrain.features import GeometryPart
from warp_torchrl.world.terrain.grid import Grid
from warp_torchrl.world.terrain.vector import Shape, burn_in, mark

GRID = Grid((12, 12), None, rasterio.Affine(1.0, 0.0, 0.0, 0.0, -1.0, 12.0))
"""12 x 12 cells of one metre, rows from the top: the place x, y lies in column x, row 12 - y."""


def polygon(*rings, feature=0, kind="Polygon"):
    """Return a polygon of (column, row) corners, closed here."""
    arrays = [
        np.array([(x, 12.0 - y) for x, y in (*ring, *([ring[0]] if kind == "Polygon" else []))]) for ring in rings
    ]
    return Shape(GeometryPart(kind, arrays), {}, feature)


def strip(start, end, width):
    """Return a strip between two places (column, row)."""
    (x, y), (u, v) = start, end
    length = math.hypot(u - x, v - y)
    off = (y - v) / length * width / 2, (u - x) / length * width / 2
    return [(x + off[0], y + off[1]), (u + off[0], v + off[1]), (u - off[0], v - off[1]), (x - off[0], y - off[1])]


def drawn(cells):
    return "\n".join("".join("#" if cell else "." for cell in row) for row in cells)


def rows(cells):
    return [row.rstrip(".") for row in drawn(cells).splitlines()]


@pytest.mark.parametrize(
    "rings, expected",
    [
        ([[(2, 1), (5, 1), (5, 4), (2, 4)]], ["", "..###", "..###", "..###"]),
        ([[(2.6, 1.6), (4.4, 1.6), (4.4, 3.4), (2.6, 3.4)]], ["", "", "...#"]),  # reaches four, holds one middle
        ([[(2.6, 1.6), (2.9, 1.6), (2.9, 1.9), (2.6, 1.9)]], ["", "..#"]),  # holds none
        ([[(1, 1), (6, 1), (6, 4), (1, 4)], [(2, 2), (5, 2), (5, 3), (2, 3)]], ["", ".#####", ".#...#", ".#####"]),
        ([strip((0.2, 1.2), (5.8, 1.2), 0.2)], ["", "######"]),  # along a row, off the middles
        ([strip((1.2, 1.5), (1.2, 4.5), 0.2)], ["", ".#", ".#", ".#", ".#"]),
        ([[(1.1, 0.1), (1.3, 0.1), (1.3, 3.1), (4.9, 3.1), (4.9, 3.3), (1.1, 3.3)]], [".#", ".#", ".#", ".####"]),
        ([strip((0.2, 0.2), (3.8, 3.8), 0.2)], ["#", ".#", "..#", "...#"]),  # through the middles, corner to corner
        ([[(0, 0), (3, 0), (3, 2.9), (6.9, 2.9), (6.9, 2.95), (3, 2.95), (3, 3), (0, 3)]], ["###", "###", "#######"]),
        (
            [[(0.6, 0.6), (4.4, 0.6), (4.4, 2.45), (8.9, 2.45), (8.9, 2.55), (4.4, 2.55), (4.4, 4.4), (0.6, 4.4)]],
            ["", ".###", ".########", ".###"],  # the tail is marked to its end, the edge of the square is not
        ),
    ],
    ids=["square", "off the grid", "small", "hole", "row", "column", "L", "diagonal", "tail", "tail off the grid"],
)
def test_a_polygon_marks_the_middles_in_it_and_what_is_narrower_than_a_cell_there(rings, expected):
    assert rows(mark([polygon(*rings)], GRID)) == expected + [""] * (12 - len(expected))


def test_a_diagonal_off_the_middles_marks_what_it_touches_alone_and_beside_a_square():
    # From (0.25, 0.75) it runs through (0, 0), (0, 1) .. : each cell of the diagonal and the one below it.
    thin, square = strip((0.25, 0.75), (6.25, 6.75), 0.1), [(8, 8), (11, 8), (11, 11), (8, 11)]
    alone = mark([polygon(thin)], GRID)
    assert np.argwhere(alone).tolist() == [[r, c] for r in range(7) for c in (r - 1, r) if c >= 0]
    both = mark([polygon(thin), polygon(square, feature=1)], GRID)
    assert both.sum() == alone.sum() + 9 and (both[:7, :7] == alone[:7, :7]).all()


@pytest.mark.parametrize("width", [0.05, 0.5, 0.9])
def test_strips_of_any_direction_hang_together_from_end_to_end(width):
    draws = np.random.default_rng(4)
    for _ in range(60):
        ends = draws.uniform(0.6, 11.4, (2, 2))
        if math.hypot(*(ends[0] - ends[1])) < 1.0:
            continue
        cells = mark([polygon(strip(*ends, width))], GRID)
        for x, y in ends:
            row, column = int(y), int(x)
            assert cells[max(row - 1, 0) : row + 2, max(column - 1, 0) : column + 2].any(), drawn(cells)
        assert len(pieces(cells)) == 1, drawn(cells)


def pieces(cells):
    """Return the pieces of cells that hang together by sides or corners."""
    left, found = {tuple(each) for each in np.argwhere(cells).tolist()}, []
    while left:
        piece, edge = set(), {left.pop()}
        while edge:
            piece |= edge
            around = {(r + i, c + j) for r, c in edge for i in (-1, 0, 1) for j in (-1, 0, 1)}
            edge = around & left
            left -= edge
        found.append(piece)
    return found


def test_what_lies_beyond_the_map_counts_for_what_is_on_it():
    # The polygon is wide beyond the west edge and touches the first column by a tenth: no middle there, and not narrow.
    assert not mark([polygon([(-5, 2), (0.1, 2), (0.1, 6), (-5, 6)])], GRID).any()


def test_a_road_along_a_diagonal_has_its_worth_and_parts_of_one_feature_count_once():
    road, houses = (
        polygon(strip((0.25, 0.75), (6.25, 6.75), 0.1)),
        polygon([(9, 1), (11, 1), (11, 2), (9, 2)], feature=1),
    )
    worth = burn_in([road, houses], [100.0, 5.0], GRID)
    assert worth[6, 6] == 100.0 and worth[1, 9] == worth[1, 10] == 5.0 and worth.sum() == 13 * 100.0 + 2 * 5.0
    line = polygon([(0.5, 9.5), (4.5, 9.5)], kind="LineString")
    again = polygon([(2.5, 9.5), (6.5, 9.5)], kind="LineString")
    assert burn_in([line, again], [1.0, 1.0], GRID)[9].tolist() == [1.0] * 7 + [0.0] * 5
    other = again._replace(feature=1)
    assert burn_in([line, other], [1.0, 1.0], GRID)[9].tolist() == [1.0, 1.0, 2.0, 2.0, 2.0, 1.0, 1.0] + [0.0] * 5
