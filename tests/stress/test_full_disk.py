"""A disk that fills at every stage of a run, and one that is read-only: exit code 6, and what was saved stays sound."""

import errno
import logging
import shutil
import subprocess
from pathlib import Path

import pytest

from tests.stress.processes import TINY
from tests.stress.saves import KINDS, left
from warp_torchrl.commands.command import train
from warp_torchrl.runs.checkpoint import CheckpointError, newest

pytestmark = pytest.mark.stress
DISK = 4 * 2**20
SHORT = [*TINY, "total_frames=256", "checkpoint.interval=64", "evaluation.episodes=2"]


@pytest.fixture
def small_disk(tmp_path):
    """A file system of 4 MiB."""
    folder = tmp_path / "disk"
    folder.mkdir()
    mounted = subprocess.run(
        ["mount", "-t", "tmpfs", "-o", f"size={DISK}", "tmpfs", str(folder)], capture_output=True, check=False
    )
    if mounted.returncode:
        pytest.skip(f"no file system can be mounted here: {mounted.stderr.decode().strip()}")
    yield folder
    subprocess.run(["umount", "-l", str(folder)], check=True)


@pytest.fixture
def run_here(monkeypatch, capfd):
    def run(*arguments):
        monkeypatch.setattr("sys.argv", ["train.py", *arguments])
        with pytest.raises(SystemExit) as end:
            train()
        return end.value.code, capfd.readouterr().err.strip().splitlines()

    return run


def test_a_disk_that_fills_at_every_stage(small_disk, run_here, monkeypatch, capfd):
    monkeypatch.chdir(small_disk)
    stages, filler = [], small_disk / "filler"
    room = 0
    while True:
        filler.write_bytes(bytes(DISK - room))
        run = f"run{room}"
        code, errors = run_here(*SHORT, f"hydra.run.dir={run}")
        if code == 0:
            break
        assert code == 6 and errors[-1].endswith("No space left on device"), errors
        assert "Traceback" not in "".join(errors)
        path = errors[-1].removeprefix("error: ").partition(": ")[0]
        try:
            found, skipped = newest(small_disk / run)
            assert not skipped
            filler.unlink()
            code, errors = run_here(f"resume={run}")
            assert code == 0, errors
        except CheckpointError as error:
            assert "no folder in" in str(error) or "nothing there" in str(error)
            found = None
        stages.append(f"{Path(path).name} ({'nothing' if found is None else found.manifest.frames} saved)")
        subprocess.run(["rm", "-rf", str(small_disk / run)], check=True)
        room += 160 * 1024
    with capfd.disabled():
        print(f"\nfull disks told and survived: {len(stages)} / {len(stages)}: {', '.join(stages)}")
    assert len(stages) > 5


def test_a_read_only_folder(small_disk, run_here, monkeypatch):
    monkeypatch.chdir(small_disk)
    code, _ = run_here(*SHORT, "total_frames=64", "hydra.run.dir=run")
    assert code == 0
    (small_disk / "run" / "evaluation.json").unlink()
    for handler in logging.getLogger().handlers:
        handler.close()  # Hydra's train.log would keep the disk busy
    subprocess.run(["mount", "-o", "remount,ro", str(small_disk)], check=True)
    for arguments in ([*SHORT, "hydra.run.dir=other"], ["resume=run"]):
        code, errors = run_here(*arguments)
        assert code == 6 and errors[-1].startswith("error: ") and errors[-1].endswith("Read-only file system")
        assert "Traceback" not in "".join(errors)
    assert newest(small_disk / "run")[1] == []


def test_a_disk_that_fills_while_recordings_are_saved(small_disk, capfd):
    people, filler, stages = small_disk / "people", small_disk / "filler", []
    kind, number, room = KINDS["recording"], 1, 0
    while number < 3:
        filler.write_bytes(bytes(max(0, shutil.disk_usage(small_disk).free - room)))
        try:
            kind.save(people, number)
        except OSError as error:
            assert error.errno == errno.ENOSPC and error.filename
            stages.append(f"{room // 1024} KiB")
            room += 12 * 1024
        else:
            number, room = number + 1, 0
        filler.unlink()
        assert (kind.held(people) if number > 1 else set()) == set(range(1, number)) and not left(people)
    with capfd.disabled():
        print(
            f"\nfull disks told and survived, of recordings: {len(stages)} / {len(stages)}, room of {', '.join(stages)}"
        )
    assert len(stages) > 5
