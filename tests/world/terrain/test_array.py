"""A user's arrays: taken as they are or from a file, whole or cropped, and every refusal in one line."""

import pickle
import time
import zipfile
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
import torch
from torch import Tensor

from warp_torchrl.world.arrays.random import world_key
from warp_torchrl.world.terrain.array import Array


def keys(worlds: int) -> Tensor:
    seed = torch.arange(worlds)
    return world_key(seed, torch.zeros_like(seed))


def refuse(words: str, **fields: object) -> None:
    with pytest.raises(ValueError, match=words) as caught:
        Array(**fields)
    assert "\n" not in str(caught.value)


@pytest.fixture
def npz(tmp_path: Path) -> Path:
    """A map of 20 x 30 cells whose elevation tells the place, 100 x row + column."""
    path = tmp_path / "map.npz"
    metres = np.add.outer(100.0 * np.arange(20), np.arange(30))
    np.savez(path, cover=np.full((20, 30), 2), elevation=metres, age=np.full((20, 30), 7))
    return path


def test_an_array_is_taken_as_it_is() -> None:
    cover = [[0, 1, 2, 3], [3, 3, 3, 4], [2, 2, 2, 2], [1, 1, 1, 1]]
    age = [[9, 9, 9, 9], [1, 2, 3, 4], [0, 0, 0, 0], [10, 10, 10, 10]]
    metres = [[0.0, 1.0, 2.0, 3.0]] * 4
    ground = Array(cover=cover, age=age, elevation=metres)(keys(2))
    assert ground.cover.tolist() == [cover] * 2
    assert ground.elevation.tolist() == [metres] * 2
    # Trees drawn on the lake and on the bare cell are not there.
    assert ground.age.tolist() == [[[0, 9, 9, 9], [1, 2, 3, 0], [0, 0, 0, 0], [10, 10, 10, 10]]] * 2
    assert ground.corner.tolist() == [[0, 0]] * 2
    assert (ground.cover.dtype, ground.elevation.dtype, ground.age.dtype) == (torch.uint8, torch.float32, torch.uint8)


def test_an_array_without_ages_draws_them_for_each_world() -> None:
    age = Array(cover=np.full((16, 20), 3))(keys(2)).age
    assert age.shape == (2, 16, 20)
    assert not torch.equal(age[0], age[1])


def test_a_whole_array_may_have_any_fuel() -> None:
    for size in (None, 4, (4, 4)):
        assert (Array(cover=np.zeros((4, 4)), size=size)(keys(2)).cover == 0).all()


def test_an_array_may_come_from_a_file(npz: Path) -> None:
    source = Array(path=str(npz))
    assert source.size == (20, 30)
    ground = source(keys(1))
    assert (ground.age == 7).all() and (ground.cover == 2).all()
    assert ground.elevation[0, 19, 29] == 1929.0


def test_a_smaller_size_crops_a_window_for_each_world(npz: Path) -> None:
    source = Array(path=str(npz), size=(8, 10))
    ground = source(keys(300))
    assert ground.cover.shape == (300, 8, 10) and source.size == (8, 10)
    row, column = ground.corner.unbind(1)
    assert torch.equal(ground.elevation[:, 0, 0], (100 * row + column).float())
    assert row.min() == 0 and row.max() == 12 and column.min() == 0 and column.max() == 20
    fixed = Array(path=str(npz), size=8, row=3, column=4)(keys(2))
    assert fixed.corner.tolist() == [[3, 4]] * 2 and (fixed.elevation[:, 0, 0] == 304.0).all()


def test_windows_keep_to_places_with_fuel() -> None:
    cover = np.zeros((8, 20))
    cover[:, 12:] = 3
    share = (Array(cover=cover, size=8, min_fuel=0.75)(keys(100)).cover == 3).float().mean((1, 2))
    assert torch.unique(share).tolist() == [0.75, 0.875, 1.0]


def test_the_cell_size_is_the_users() -> None:
    assert Array(cover=[[3] * 4] * 4).cell_size == 30.0
    assert Array(cover=[[3] * 4] * 4, cell_size=10.0).cell_size == 10.0


def test_arrays_are_equal_where_their_layers_and_windows_are(npz: Path) -> None:
    cover = np.full((20, 30), 3)
    one = Array(cover=cover)
    assert one == Array(cover=torch.from_numpy(cover)) == Array(cover=cover.tolist())
    assert hash(one) == hash(Array(cover=cover.astype(np.uint8)))
    other = cover.copy()
    other[5, 5] = 2
    for different in (Array(cover=other), Array(cover=cover.T), Array(cover=cover, age=cover), replace(one, size=8)):
        assert one != different
    assert replace(one) == one and pickle.loads(pickle.dumps(one)) == one
    with np.load(npz) as layers:
        assert Array(path=str(npz)) == Array(**layers) != one


def test_a_caller_who_changes_his_array_does_not_change_the_landscape() -> None:
    cover = np.full((4, 4), 3, np.uint8)
    source = Array(cover=cover)
    cover[:] = 0
    assert (source(keys(1)).cover == 3).all()


@pytest.mark.parametrize(
    ("fields", "words"),
    [
        ({}, "^path must name an .npz file with cover where cover is not passed, got None"),
        ({"cover": [[3] * 4] * 4, "path": "x.npz"}, "^path must be null where arrays are passed, got x.npz and cover"),
        ({"path": 7}, "^path must be a text or PathLike or null, got 7"),
        ({"cover": "forest"}, "^cover must hold numbers in two dimensions"),
        ({"cover": [["f"] * 4] * 4}, "^cover must hold numbers"),
        ({"cover": [[3] * 4, [3] * 5] * 2}, "^cover must be an array of numbers"),
        ({"cover": [3] * 16}, "^cover must .*two dimensions"),
        ({"cover": [[5] * 4] * 4}, r"^cover must hold whole numbers in 0\.\.4, got 5"),
        ({"cover": [[3] * 4] * 4, "age": [[11] * 4] * 4}, r"^age must hold whole numbers in 0\.\.10, got 11"),
        ({"cover": [[3] * 4] * 4, "elevation": [[1e300] * 4] * 4}, "^elevation must be finite and in .*, got 1e"),
        (
            {"cover": [[3] * 4] * 4, "elevation": [[-9999] * 4] * 4},
            r"^elevation must .* \[-1000, 10000\] m .* -9999",
        ),
        ({"cover": [[3] * 4] * 4, "elevation": [[0] * 5] * 4}, r"^elevation must have the shape of cover \(4, 4\)"),
        ({"cover": [[3] * 3] * 3}, "^size must"),
        ({"cover": [[3] * 8] * 8, "size": 9}, "^size must fit in the map of 8 x 8 cells, got 9 x 9"),
        ({"cover": [[3] * 8] * 8, "row": 1}, r"^row must be whole, in 0\.\.0"),
        ({"cover": [[3] * 8] * 8, "size": 4, "row": 1}, "^column must be whole"),
        ({"cover": [[3] * 8] * 8, "size": 4, "row": 5, "column": 0}, r"^row must be whole, in 0\.\.4"),
        ({"cover": [[0] * 8] * 8, "size": 4}, "^size must leave some place"),
    ],
)
def test_bad_arrays_are_refused_in_one_line(fields: dict[str, object], words: str) -> None:
    refuse(words, **fields)


def test_files_that_are_no_archives_of_arrays_are_refused(tmp_path: Path, npz: Path) -> None:
    text = tmp_path / "text.npz"
    text.write_text("not an archive")
    objects = tmp_path / "objects.npz"
    np.savez(objects, cover=np.array([{"a": 1}], dtype=object))
    words = tmp_path / "words.npz"
    with zipfile.ZipFile(words, "w") as archive:
        archive.writestr("cover.npy", "grass and trees")
    for path in (tmp_path / "nothing.npz", text, objects, words, tmp_path, "", "x" * 300):
        refuse("^path must name an .npz file", path=str(path))
    bare = tmp_path / "bare.npz"
    np.savez(bare, elevation=np.zeros((4, 4)))
    refuse("^path must name an .npz file with cover", path=str(bare))


def test_a_damaged_file_is_refused_wherever_it_is_damaged(tmp_path: Path, npz: Path) -> None:
    whole, path = npz.read_bytes(), tmp_path / "cut.npz"
    for length in (0, 3, 30, 200, len(whole) // 2, len(whole) - 1):
        path.write_bytes(whole[:length])
        refuse("^path must name an .npz file", path=str(path))
    for place in range(0, len(whole), len(whole) // 97):
        path.write_bytes(whole[:place] + bytes([whole[place] ^ 0xFF]) + whole[place + 1 :])
        try:
            Array(path=str(path))
        except ValueError as error:
            assert "\n" not in str(error)


def test_an_enormous_file_is_refused_from_its_header(tmp_path: Path) -> None:
    path = tmp_path / "huge.npz"
    with zipfile.ZipFile(path, "w") as archive, archive.open("cover.npy", "w") as member:
        header = {"descr": "|u1", "fortran_order": False, "shape": (400_000, 400_000)}
        np.lib.format.write_array_header_1_0(member, header)
    start = time.perf_counter()
    refuse("^path must name arrays of at most 100000000 cells, .* declares 160000000000", path=str(path))
    assert time.perf_counter() - start < 2.0


def test_a_window_has_the_assets_of_its_cells() -> None:
    worth = np.arange(80.0).reshape(8, 10)
    ground = Array(cover=np.full((8, 10), 3), assets=worth, size=4, row=2, column=5)(world_key(torch.arange(2)))
    assert torch.equal(ground.layer("assets")[1], torch.from_numpy(worth[2:6, 5:9]).float())


def test_a_window_has_the_fuel_and_canopy_of_its_cells() -> None:
    place = np.arange(80.0).reshape(8, 10)
    planes = {"fuel": 101 + place, "canopy_cover": place, "canopy_height": place / 4}
    planes |= {"canopy_base_height": place / 8, "canopy_bulk_density": place / 64}
    ground = Array(cover=np.full((8, 10), 3), **planes, size=4, row=2, column=5)(keys(2))
    for name, values in planes.items():
        plane = ground.layer(name)
        assert plane.dtype == (torch.int16 if name == "fuel" else torch.float32)
        assert plane[1].tolist() == values[2:6, 5:9].tolist()
    assert Array(cover=np.full((8, 10), 3))(keys(1)).layer("fuel") is None
    with pytest.raises(ValueError, match=r"^canopy_bulk_density must be given with canopy_height and"):
        Array(cover=np.full((8, 10), 3), canopy_bulk_density=place / 64, canopy_cover=place)


def test_fuel_tells_arrays_apart_and_comes_from_files_too(tmp_path: Path) -> None:
    cover = np.full((4, 4), 3)
    np.savez(tmp_path / "land.npz", cover=cover, fuel=cover + 100)
    from_file = Array(path=tmp_path / "land.npz")
    assert from_file == Array(cover=cover, fuel=cover + 100) != Array(cover=cover)
    assert (from_file(keys(1)).layer("fuel") == 103).all()


def test_the_oldest_trees_stand_on_every_cell_of_fuel() -> None:
    cover = [[0, 1, 2, 3]] * 3 + [[4, 4, 3, 3]]
    ground = Array(cover=cover, ages="oldest")(keys(3))
    assert ground.age.tolist() == [[[0, 10, 10, 10]] * 3 + [[0, 0, 10, 10]]] * 3 and ground.age.dtype == torch.uint8
    refuse(
        "^ages must be drawn where age is given, which tells them, got oldest", cover=cover, age=cover, ages="oldest"
    )


def test_the_corner_is_told_where_every_world_has_the_same_window() -> None:
    cover = np.full((8, 10), 3)
    assert Array(cover=cover).corner == (0, 0) and Array(cover=cover, size=4, row=2, column=5).corner == (2, 5)
    assert Array(cover=cover, size=4).corner is None
