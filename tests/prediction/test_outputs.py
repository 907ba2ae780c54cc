"""The folder of a prediction: locked first, filled last, and what an earlier one left is replaced."""

import json
import logging

import pytest

from tests.commands.test_predict import arguments, folder
from warp_torchrl.commands import predict as command
from warp_torchrl.commands.predict import main
from warp_torchrl.system import memory
from warp_torchrl.system.exit_codes import DISK, DONE, IN_USE, MISTAKE
from warp_torchrl.system.lock import RunFolderLock
from warp_torchrl.world.fires.alone import Fires

__all__ = ["folder"]
MAPS = {"burn_probability.tif", "arrival_hours.tif", "rate.tif", "intensity.tif", "flame_length.tif"}


@pytest.fixture(autouse=True)
def no_figure(monkeypatch):
    """Figures and films take longer than all else."""

    def missing(*_):
        raise ImportError("not here")

    monkeypatch.setattr(command, "write_figure", missing)
    monkeypatch.setattr(command, "write_animation", lambda path, *_: path.touch())


def names(out):
    return {path.name for path in out.iterdir()} - {".lock"}


def told(out):
    return json.loads((out / "report.json").read_text())


def test_an_earlier_prediction_is_replaced_and_nothing_else(folder):
    out = folder / "out"
    assert main(arguments(folder, animation="true")) == DONE and "fire.gif" in names(out)
    (out / "notes.txt").write_text("mine")
    (out / "extra.tif").write_text("mine too")
    assert main(arguments(folder, overwrite="true", fires=3)) == DONE
    assert names(out) == {*MAPS, "perimeters.geojson", "report.md", "report.json", "notes.txt", "extra.tif"}
    assert told(out)["fires"] == 3 and (out / "notes.txt").read_text() == "mine"


def test_two_predictions_into_one_folder_are_refused_before_the_work(folder, monkeypatch, capsys):
    monkeypatch.setattr(command, "read_case", lambda *_: pytest.fail("it began to work"))
    lock = RunFolderLock(folder / "out")
    try:
        assert main(arguments(folder)) == IN_USE
    finally:
        lock.release()
    assert capsys.readouterr().err.count("\n") == 1


class Killed(BaseException):
    """As an interruption from the keyboard, which no ``except Exception`` holds."""


@pytest.mark.parametrize("name", ["write_layers", "write_perimeters", "write_animation", "page"])
def test_what_ends_in_the_middle_leaves_the_folder_as_it_was(name, folder, monkeypatch):
    out = folder / "out"
    out.mkdir()
    for each in ("report.json", "report.md", "rate.tif"):
        (out / each).write_text("of an earlier one")

    def fail(*_):
        raise Killed

    monkeypatch.setattr(command, name, fail)
    with pytest.raises(Killed):
        main(arguments(folder, overwrite="true", animation="true", fires=1))
    assert {each: (out / each).read_text() for each in names(out)} == dict.fromkeys(
        ("report.json", "report.md", "rate.tif"), "of an earlier one"
    )
    with pytest.raises(Killed):
        main(arguments(folder, out=folder / "new", animation="true", fires=1))
    assert not (folder / "new").exists()


def test_a_full_disk_is_told_with_its_code(folder, monkeypatch, capsys):
    def full(path, *_):
        raise OSError(28, "No space left on device", str(path))

    monkeypatch.setattr(command, "write_perimeters", full)
    assert main(arguments(folder, fires=1)) == DISK and not (folder / "out").exists()
    assert capsys.readouterr().err.strip().endswith("No space left on device")


def test_a_map_that_memory_does_not_hold_is_refused_before_it_is_read(folder, monkeypatch, capsys):
    monkeypatch.setattr(memory, "available", lambda: 50_000)
    assert main(arguments(folder)) == MISTAKE
    line = capsys.readouterr().err.strip().splitlines()[-1]
    assert "memory must hold 2 layers of 40 x 44 cells" in line and "take a smaller map or window" in line
    assert not (folder / "out").exists()


def test_fires_that_memory_does_not_hold_are_refused_before_they_burn(folder, monkeypatch, capsys):
    monkeypatch.setattr(memory, "available", lambda: 2_000_000)
    monkeypatch.setattr(Fires, "burn", lambda *_: pytest.fail("it began to burn"))
    assert main(arguments(folder, fires=1_000_000)) == MISTAKE and not (folder / "out").exists()
    line = capsys.readouterr().err.strip().splitlines()[-1]
    assert "memory must hold the arrival times of 1000000 fires in 40 x 44 cells, which wants 3.5 GB" in line


def test_the_report_and_the_log_name_what_was_read(folder, monkeypatch, caplog):
    from warp_torchrl.system.provenance import Provenance, report_file

    read, one = command.read_case, Provenance(key="weather", file="w.csv", read={"WS": "km/h"}, left=("GUST",))
    monkeypatch.setattr(command, "read_case", lambda *given: report_file(one) or read(*given))
    caplog.set_level(logging.INFO, "warp_torchrl")
    assert main(arguments(folder, fires=1)) == DONE
    assert one.as_values in told(folder / "out")["files"]
    assert f"- {one.line}\n" in (folder / "out" / "report.md").read_text()
    assert one.line in caplog.text
