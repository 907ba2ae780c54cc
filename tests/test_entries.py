"""What observations declare of their entries is plain data that a manifest keeps."""

import json

import pytest

from tests.conftest import small_world
from warp_torchrl.entries import Part, Planes, Target, TeamPlanes, Vector, from_plain, to_plain
from warp_torchrl.env.observation import STATE_SIDE, CriticState, Local, Paper, Surroundings

STATE = CriticState(small_world())
PRESETS = [Surroundings(), Surroundings(centred=False, identity=False), Local(channels=("age", "threat")), Paper()]
SPACES = [(name, space) for preset in PRESETS for name, space in preset.spaces(small_world()).items()]


@pytest.mark.parametrize("symmetry", [*(space.symmetry for _, space in SPACES), STATE.symmetry], ids=repr)
def test_what_is_declared_is_read_back_from_json(symmetry):
    assert from_plain(json.loads(json.dumps(to_plain(symmetry)))) == symmetry


@pytest.mark.parametrize("plain", [{"kind": "Sphere"}, {"kind": "Planes"}, {}], ids=repr)
def test_what_is_no_symmetry_is_refused(plain):
    with pytest.raises((ValueError, KeyError)):
        from_plain(plain)


@pytest.mark.parametrize(
    ("symmetry", "shape", "fits"),
    [
        (Planes(3), (3, 5, 5), True),
        (Planes(3), (3, 5, 4), False),
        (Planes(3), (12, 5, 5), False),
        (Planes(3), (75,), False),
        (Planes(3, is_flat=True), (75,), True),
        (Planes(3, Target(3)), (3, 5, 5), False),
        (Vector((Part("place", ("row", "column")), Part("scalar", ("tank",)))), (3,), True),
        (Vector((Part("place", ("row", "column")), Part("scalar", ("tank",)))), (4,), False),
        (Vector((Part("vector", ("east", "north", "up")),)), (3,), False),
        (Vector((Part("spin", ("up",)),)), (1,), False),
        (STATE.symmetry, (len(STATE.names), STATE_SIDE, STATE_SIDE), True),
        (TeamPlanes(8, 7, (4, 2)), (8, 16, 16), False),
        (TeamPlanes(8, 0, (7, 2)), (8, 16, 16), False),
        (TeamPlanes(8, 0, (4, 2)), (8, 15, 15), False),
    ],
    ids=repr,
)
def test_a_symmetry_fits_entries_of_its_shape(symmetry, shape, fits):
    assert symmetry.fits(shape) is fits


def test_the_place_of_an_agent_is_found_among_the_parts():
    parts = (Part("scalar", ("a", "b")), Part("place", ("row", "column")), Part("scalar", ("c",)))
    assert Vector(parts).place() == slice(2, 4) and Vector(parts[:1]).place() is None


def test_vectors_that_turn_alike_are_equal():
    tank, battery = Part("scalar", ("tank",)), Part("scalar", ("battery",))
    wind = Part("vector", ("east", "north"))
    joined = Vector((wind, Part("scalar", ("tank", "battery")), wind))
    assert Vector((wind, tank, battery, wind)) == joined and joined.parts[1].names == ("tank", "battery")
    assert len(Vector((wind, wind)).parts) == 2
