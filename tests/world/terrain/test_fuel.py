"""Tables of class codes: what the presets say of each code, and a user's own."""

import numpy as np
import pytest
import torch

from tests.world.rasters import FIRES, LANDFIRE, needs_fires, needs_landfire, read
from warp_torchrl.world.behaviour.fbp_fuels import fbp_fuels
from warp_torchrl.world.state.cells import holds_trees
from warp_torchrl.world.state.state import Cover
from warp_torchrl.world.terrain.fuel import FBFM13, FBFM40, FBP, NO_FUEL_CODE, TABLES, WORLDCOVER, code_table, to_cover

LETTERS = {Cover.LAKE: "L", Cover.WETLAND: "W", Cover.GRASSLAND: "G", Cover.FOREST: "F", Cover.BARE: "B"}


def drawn(codes, table):
    """Return the covers of rows of codes as text."""
    codes = np.asarray(codes)
    cover = to_cover(codes, np.ones(codes.shape, bool), code_table(table))
    return ["".join(LETTERS[code] for code in row) for row in cover.tolist()]


def test_fbfm13_codes_become_our_covers():
    codes = [[1, 2, 3, 93], [4, 5, 6, 7], [8, 9, 10, 98], [11, 12, 13, 98], [91, 92, 99, 98]]
    assert drawn(codes, "fbfm13") == ["GGGG", "GGGG", "FFFL", "FFFL", "BBBL"]
    assert len(FBFM13) == 13 + 5


def test_fbfm40_codes_become_our_covers():
    # Scott and Burgan (2005), table 7: GR 1-9, GS 1-4, SH 1-9, TU 1-5, TL 1-9, SB 1-4 and NB 1, 2, 3, 8, 9.
    rows = [[101, 109, 121, 124], [141, 149, 93, 93], [161, 165, 181, 189], [201, 204, 181, 189], [91, 92, 99, 98]]
    assert drawn(rows, "fbfm40") == ["GGGG", "GGGG", "FFFF", "FFFF", "BBBL"]
    assert len(FBFM40) == 9 + 4 + 9 + 5 + 9 + 4 + 5


def test_worldcover_classes_become_our_covers():
    assert drawn([[10, 20, 30, 40], [80, 90, 95, 95], [50, 60, 70, 100]], "worldcover") == ["FGGG", "LWWW", "BBBB"]
    assert len(WORLDCOVER) == 11


def test_fbp_codes_become_our_covers():
    # C-1 .. C-7, D-1, D-2, S-1 .. S-3, O-1a, O-1b, M-1 .. M-4, the graded ones, no fuel and water.
    codes = [[1, 2, 5, 7], [11, 12, 13, 21], [31, 32, 23, 40], [60, 90, 405, 995], [0, 101, 105, 102]]
    assert drawn(codes, "fbp") == ["FFFF", "FFFF", "GGFF", "FFFF", "BBBL"]
    assert len(FBP) == 7 + 3 + 3 + 2 + 6 + 600 + 9


def test_what_burns_in_the_fbp_table_is_what_has_a_rate_of_spread():
    codes = torch.tensor(sorted(FBP))
    burns = fbp_fuels(codes).a > 0.0
    assert torch.equal(burns, holds_trees(torch.tensor([int(FBP[code]) for code in codes.tolist()], dtype=torch.uint8)))
    assert FBP[NO_FUEL_CODE] == Cover.BARE and FBFM13[NO_FUEL_CODE] == FBFM40[NO_FUEL_CODE] == Cover.BARE


@needs_fires
@pytest.mark.parametrize("fire, table", [("arrowhead", FBP), ("glacier", FBP), ("mica", FBP), ("clinge", FBFM40)])
def test_every_code_of_the_real_fires_is_in_its_table(fire, table):
    assert set(np.unique(read(FIRES / fire / "fuel.asc")).tolist()) <= set(table)


@pytest.mark.parametrize("text", ["10: forest\n80: lake\n", "{10: 3, 80: 0}", "'10': FOREST\n80: '0'\n"])
def test_a_table_may_be_a_file(tmp_path, text):
    path = tmp_path / "my_table.yaml"
    path.write_text(text)
    assert code_table(str(path)) == code_table(path) == {10: Cover.FOREST, 80: Cover.LAKE}


@pytest.mark.parametrize(
    "text, words",
    [
        (None, "^table must name a yaml file that can be read, .*No such file"),
        ("10: [", "^table must name a yaml file that can be read, .*my_table.yaml cannot: .*while parsing"),
        ("", "^table must be one of .*got .*my_table.yaml"),
        ("forest", "^table must be one of"),
        ("10: jungle", "^table must be one of"),
        ("10: [forest]", "^table must be one of"),
        ("10: forest\n10: lake", "my_table.yaml cannot: .* line 2 has the key 10 once more"),
        ("10: &a forest\n20: *a", "my_table.yaml cannot: .* line 2 has an alias"),
        ("10: !!python/name:os.system", "my_table.yaml cannot: .* line 1 has a tag"),
        ("10: \0", "my_table.yaml cannot: .* holds a NUL"),
    ],
)
def test_a_file_that_is_no_table_is_refused_in_one_line(tmp_path, text, words):
    path = tmp_path / "my_table.yaml"
    if text is not None:
        path.write_text(text)
    with pytest.raises(ValueError, match=words) as caught:
        code_table(str(path))
    assert "\n" not in str(caught.value)


@needs_landfire
@pytest.mark.parametrize("layer, table", [("LC22_F13_230", FBFM13), ("LC22_F40_230", FBFM40)])
def test_every_code_of_a_real_map_is_in_its_table(layer, table):
    assert set(np.unique(read(LANDFIRE / f"{layer}.tif")).tolist()) - {32767} <= set(table)


@needs_landfire
def test_both_fuel_layers_of_a_real_map_tell_much_the_same_cover():
    thirteen, forty = (read(LANDFIRE / f"LC22_{layer}_230.tif") for layer in ("F13", "F40"))
    known = thirteen != 32767
    one, two = to_cover(thirteen, known, FBFM13)[known], to_cover(forty, known, FBFM40)[known]
    assert (one == two).mean() > 0.99


@pytest.mark.parametrize("table", [{10: "forest", 80: "LAKE"}, {10: 3, 80: Cover.LAKE}, {"10": "Forest", "80": 0}])
def test_a_table_of_ones_own(table):
    assert code_table(table) == {10: Cover.FOREST, 80: Cover.LAKE}


@pytest.mark.parametrize(
    "table",
    ["fbfm12", "", None, 7, {}, {8: "jungle"}, {8: 5}, {8: -1}, {8: None}, {8.5: 3}, {"grass": 2}, {1: 2, "1": 3}],
)
def test_a_table_that_is_none_is_refused_in_one_line(table):
    with pytest.raises(ValueError, match=r"^table must be one of fbfm13, .*, nlcd, corine, a .*bare") as caught:
        code_table(table)
    assert "\n" not in str(caught.value)


def test_what_is_not_known_is_bare_whatever_its_code():
    codes, known = np.array([[8, -9999], [np.nan, 98]]), np.array([[True, False], [False, True]])
    assert to_cover(codes, known, TABLES["fbfm13"]).tolist() == [[Cover.FOREST, Cover.BARE], [Cover.BARE, Cover.LAKE]]


@pytest.mark.parametrize(
    "codes, words",
    [
        ([[8, 8.5]], "^fuel must hold whole class codes, got 8.5"),
        ([[8, np.nan]], "^fuel must hold whole class codes, got nan"),
        ([[8, 20, 0, 20]], "^table must have every code of fuel, it lacks 2: 0, 20$"),
        ([[101, 98, 165]], "it lacks 2: 101, 165; table=fbfm40 has them$"),
        ([[10, 80, 100]], "it lacks 2: 80, 100; table=worldcover has them$"),
        ([[8, *range(14, 91)]], r"^table must have every code of fuel, it lacks 77: 14, .*, 63, \.\.\.$"),
    ],
)
def test_codes_that_are_none_or_not_in_the_table_are_refused(codes, words):
    codes = np.array(codes, float)
    with pytest.raises(ValueError, match=words):
        to_cover(codes, np.ones(codes.shape, bool), FBFM13)
