"""Outputs: complete or absent, one writer each."""

import errno
import os
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path

import pytest

from warp_torchrl.runs.config.construction import ConfigError
from warp_torchrl.runs.output import DRAFT, draft_in, output_folder, publish
from warp_torchrl.system.lock import RunFolderInUse


def write(folder: Path, overwrite: bool = False, **texts: str) -> None:
    with output_folder(folder, "out", overwrite=overwrite, last="report", replaced=["*.tif"]) as draft:
        for name, text in texts.items():
            (draft / name.replace("_", ".")).write_text(text)


def held(folder: Path) -> dict[str, str]:
    return {path.name: path.read_text() for path in folder.iterdir() if path.name != ".lock"}


def test_an_output_appears_when_it_is_complete(tmp_path):
    folder = tmp_path / "of" / "today"
    with output_folder(folder, "out", overwrite=False, last="report") as draft:
        (draft / "report").write_text("done")
        assert not (folder / "report").exists()
    assert held(folder) == {"report": "done"}


def test_a_second_writer_is_refused_at_once(tmp_path):
    with (
        output_folder(tmp_path / "a", "out", overwrite=False, last="report") as draft,
        pytest.raises(RunFolderInUse, match="in use"),
    ):
        (draft / "report").touch()
        write(tmp_path / "a", overwrite=True, report="mine")


def test_a_folder_that_holds_an_output_is_refused_and_left(tmp_path):
    write(tmp_path / "a", report="first")
    with pytest.raises(ConfigError, match=r"out: .* holds report"):
        write(tmp_path / "a", report="second")
    assert held(tmp_path / "a") == {"report": "first"}


def test_what_replaces_an_output_leaves_nothing_of_it_and_all_else(tmp_path):
    write(tmp_path / "a", report="first", fire_tif="of the first")
    (tmp_path / "a" / "mine").write_text("a note")
    write(tmp_path / "a", overwrite=True, report="second", wind_tif="of the second")
    assert held(tmp_path / "a") == {"report": "second", "wind.tif": "of the second", "mine": "a note"}


def test_a_failure_leaves_the_folder_as_it_was(tmp_path):
    write(tmp_path / "a", report="first")
    for name in ("a", "new", "of/all/new"):
        with (
            pytest.raises(ZeroDivisionError),
            output_folder(tmp_path / name, "out", overwrite=True, last="report") as draft,
        ):
            (draft / "report").write_text(str(1 / 0))
    assert held(tmp_path / "a") == {"report": "first"}
    assert not (tmp_path / "new").exists() and not (tmp_path / "of").exists()


def test_an_output_without_its_last_file_is_none(tmp_path):
    with pytest.raises(FileNotFoundError):
        write(tmp_path / "a", wind_tif="alone")
    assert not (tmp_path / "a").exists()


def test_drafts_of_ended_processes_go_and_those_of_others_stay(tmp_path):
    (tmp_path / f"{DRAFT}left" / "draft").mkdir(parents=True)
    with draft_in(tmp_path) as mine, draft_in(tmp_path) as yours:
        assert mine.is_dir() and yours.is_dir() and mine != yours
        assert not (tmp_path / f"{DRAFT}left").exists()
    assert not list(tmp_path.iterdir())


def test_a_killed_writer_leaves_a_folder_that_another_may_take(tmp_path):
    folder = tmp_path / "a"
    if not (child := os.fork()):
        with output_folder(folder, "out", overwrite=False, last="report"):
            os._exit(1)
    os.waitpid(child, 0)
    assert list(folder.glob(f"{DRAFT}*"))
    write(folder, report="done")
    assert held(folder) == {"report": "done"}


def test_many_who_publish_at_once_have_a_name_each(tmp_path):
    def one(number: int) -> Path:
        with draft_in(tmp_path) as draft:
            (draft / "content").write_text(f"{number}")
            return publish(draft, tmp_path, (f"a-{each}" for each in range(1, 100)))

    with ThreadPoolExecutor(8) as pool:
        folders = list(pool.map(one, range(40)))
    assert [int((folder / "content").read_text()) for folder in folders] == list(range(40))
    assert sorted(tmp_path.iterdir()) == sorted(folders) == sorted(tmp_path / f"a-{each}" for each in range(1, 41))


def test_a_name_that_is_taken_is_told(tmp_path):
    (tmp_path / "a").write_text("mine")
    with draft_in(tmp_path) as draft, pytest.raises(FileExistsError) as refused:
        publish(draft, tmp_path, ["a"])
    assert refused.value.errno == errno.EEXIST and refused.value.filename == str(tmp_path / "a")
    assert (tmp_path / "a").read_text() == "mine"


def test_a_result_has_the_permissions_of_its_user(tmp_path):
    (tmp_path / "usual").mkdir()
    with draft_in(tmp_path) as draft:
        folder = publish(draft, tmp_path, ["a"])
    assert folder.stat().st_mode == (tmp_path / "usual").stat().st_mode
