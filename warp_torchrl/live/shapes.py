"""Small closed meshes, made of numbers: a tree, a flame, a puff, and the vehicles; about one cell large, z up."""

from functools import lru_cache
from typing import NamedTuple

import numpy as np


class Mesh(NamedTuple):
    """A mesh of triangles."""

    vertices: np.ndarray  # float32 [V, 3] [cells]
    faces: np.ndarray  # uint32 [F, 3], counter-clockwise from outside


def joined_meshes(*parts: Mesh) -> Mesh:
    """Return shapes as one."""
    starts = np.cumsum([0, *(len(part.vertices) for part in parts[:-1])])
    return Mesh(
        np.concatenate([part.vertices for part in parts]),
        np.concatenate([part.faces + start for part, start in zip(parts, starts)]).astype(np.uint32),
    )


def box(size: tuple[float, float, float], middle: tuple[float, float, float]) -> Mesh:
    """Return a box of (x, y, z) sides about a middle [cells]."""
    corners = np.array([[x, y, z] for z in (-1, 1) for y in (-1, 1) for x in (-1, 1)], dtype=np.float32) / 2
    quads = np.array([[0, 2, 3, 1], [4, 5, 7, 6], [0, 1, 5, 4], [2, 6, 7, 3], [0, 4, 6, 2], [1, 3, 7, 5]])
    faces = quads[:, [0, 1, 2, 0, 2, 3]].reshape(-1, 3)
    return Mesh((corners * size + middle).astype(np.float32), faces.astype(np.uint32))


def spindle(radii: tuple[float, ...], heights: tuple[float, ...], sides: int) -> Mesh:
    """Return a solid of rings about the z axis, closed at both ends; a ring of radius 0 is a point.

    Args:
        radii: Of each ring, from below [cells].
        heights: Of each ring [cells].
        sides: Corners of a ring.
    """
    turn = np.arange(sides) * (2.0 * np.pi / sides)
    circle = np.stack((np.cos(turn), np.sin(turn), np.zeros(sides)), axis=1)
    rings = [circle * (radius, radius, 0.0) + (0.0, 0.0, height) for radius, height in zip(radii, heights, strict=True)]
    ends = np.array([[0.0, 0.0, heights[0]], [0.0, 0.0, heights[-1]]])
    here = np.arange(sides)
    following, top = (here + 1) % sides, len(rings) * sides
    faces = [np.stack((np.full(sides, top), following, here), axis=1)]
    for ring in range(len(rings) - 1):
        low, high = ring * sides, (ring + 1) * sides
        faces += [np.stack((low + here, low + following, high + following), axis=1)]
        faces += [np.stack((low + here, high + following, high + here), axis=1)]
    last = top - sides
    faces += [np.stack((np.full(sides, top + 1), last + here, last + following), axis=1)]
    return Mesh(np.concatenate((*rings, ends)).astype(np.float32), np.concatenate(faces).astype(np.uint32))


TILE = Mesh(
    np.array([[-0.5, -0.5, 0.0], [0.5, -0.5, 0.0], [0.5, 0.5, 0.0], [-0.5, 0.5, 0.0]], dtype=np.float32),
    np.array([[0, 1, 2], [0, 2, 3]], dtype=np.uint32),
)
"""The ground of one cell."""


@lru_cache(maxsize=1)
def tree() -> Mesh:
    """Return a conifer of height 1 on a radius of 0.4."""
    return spindle((0.4, 0.18, 0.26, 0.0), (0.08, 0.5, 0.46, 1.0), 6)


@lru_cache(maxsize=1)
def house() -> Mesh:
    """Return a house of height 1 under a gable roof."""
    x, y, eaves = 0.42, 0.34, 0.55
    roof = np.array([[-x, -y, eaves], [x, -y, eaves], [x, y, eaves], [-x, y, eaves], [-x, 0.0, 1.0], [x, 0.0, 1.0]])
    faces = np.array([[0, 1, 5], [0, 5, 4], [2, 3, 4], [2, 4, 5], [1, 2, 5], [3, 0, 4], [0, 3, 2], [0, 2, 1]])
    walls = box((2.0 * 0.9 * x, 2.0 * 0.8 * y, eaves), (0.0, 0.0, eaves / 2.0))
    return joined_meshes(walls, Mesh(roof.astype(np.float32), faces.astype(np.uint32)))


@lru_cache(maxsize=1)
def flame() -> Mesh:
    """Return a flame of height 1."""
    return spindle((0.12, 0.34, 0.2, 0.0), (0.0, 0.22, 0.6, 1.0), 5)


@lru_cache(maxsize=1)
def puff() -> Mesh:
    """Return a puff of smoke of radius 0.5."""
    return spindle((0.1, 0.45, 0.45, 0.1), (-0.48, -0.2, 0.2, 0.48), 6)


@lru_cache(maxsize=1)
def bulldozer() -> dict[str, Mesh]:
    """Return the parts of a bulldozer that faces east: ``body`` in the vehicle's colour, ``iron`` in a common one."""
    body = joined_meshes(
        box((0.86, 0.5, 0.3), (-0.02, 0.0, 0.36)),
        box((0.4, 0.44, 0.34), (-0.2, 0.0, 0.66)),
        box((0.46, 0.52, 0.06), (-0.2, 0.0, 0.86)),
    )
    tracks = [box((1.0, 0.2, 0.3), (-0.04, side, 0.16)) for side in (-0.36, 0.36)]
    arms = [box((0.4, 0.06, 0.08), (0.42, side, 0.2)) for side in (-0.3, 0.3)]
    return {"body": body, "iron": joined_meshes(*tracks, *arms, box((0.1, 1.06, 0.42), (0.64, 0.0, 0.26)))}


@lru_cache(maxsize=1)
def drone() -> dict[str, Mesh]:
    """Return the parts of an aircraft that faces east: ``body`` in the vehicle's colour, ``iron`` in a common one."""
    disc, rotors = spindle((0.32, 0.32), (0.12, 0.17), 10), [(x, y) for x in (-0.5, 0.5) for y in (-0.5, 0.5)]
    placed = [Mesh(disc.vertices + np.array([x, y, 0.0], dtype=np.float32), disc.faces) for x, y in rotors]
    body = joined_meshes(box((0.7, 0.34, 0.26), (0.0, 0.0, 0.0)), box((0.2, 0.2, 0.12), (0.42, 0.0, 0.02)))
    struts = [box((1.1, 0.1, 0.08), (0.0, side, 0.08)) for side in (-0.5, 0.5)]
    return {"body": body, "iron": joined_meshes(*placed, *struts, box((0.1, 1.1, 0.08), (0.0, 0.0, 0.08)))}
