"""The power is cut before every file-system call of a save: what was there stays, or the new one is whole."""

import shutil

import pytest

from tests.runs.test_checkpoint import saved
from tests.stress.power import with_power_cut
from warp_torchrl.runs import checkpoint as checkpoints
from warp_torchrl.runs.checkpoint import CheckpointError, newest

pytestmark = pytest.mark.stress


def first_loss(save, folder, loses_names):
    """Cut the power before each call in turn; return the calls that were survived, and what was lost at the next."""
    saved(folder / "before", 100)
    saved(folder / "before", 200)
    run, returned = folder / "run", False
    for call in range(1000):
        shutil.rmtree(run, ignore_errors=True)
        shutil.copytree(folder / "before", run)
        returned = with_power_cut(lambda: save(run), run, call, loses_names)
        try:
            found, skipped = newest(run)
            found.policy(), found.training(), found.record()
        except CheckpointError as error:
            return call, str(error)
        if skipped or found.manifest.frames not in (200, 300):
            return call, f"{skipped} is seen beside {found.path}"
        if returned:
            return call, "" if found.manifest.frames == 300 else "a save that had returned is gone"
        saved(run, 300, keep=2)
        if {each.name for each in (run / "checkpoints").iterdir()} != {"200", "300"}:
            return call, f"the next save leaves {sorted((run / 'checkpoints').iterdir())}"
    raise AssertionError("a save that never returns")


@pytest.mark.parametrize("loses_names", [False, True])
def test_no_power_cut_costs_a_checkpoint(tmp_path, loses_names):
    survived, loss = first_loss(lambda run: saved(run, 300, keep=2), tmp_path, loses_names)
    print(
        f"\npower cuts survived / tried: {survived + (not loss)} / {survived + 1} (unsynced names lost: {loses_names})"
    )
    assert not loss and survived > 20, loss


def in_place(run):
    """Write without a draft."""
    target = run / "checkpoints" / "300"
    target.mkdir()
    draft = saved(run.parent / "elsewhere", 300)
    for path in draft.iterdir():
        (target / path.name).write_bytes(path.read_bytes())


def drops_first(run):
    """Make room before the new checkpoint is safe."""
    for folder in (run / "checkpoints").iterdir():
        shutil.rmtree(folder)
    saved(run, 300, keep=2)


def without_fsync(run):
    """Trust the operating system to write soon."""
    checkpoints.disk.sync = lambda path: None
    saved(run, 300, keep=2)


def without_fsync_of_the_parent(run):
    """Flush the files, but not the list of names that the new one stands in."""
    sync = checkpoints.disk.sync
    checkpoints.disk.sync = lambda path: None if path.name == "checkpoints" else sync(path)
    saved(run, 300, keep=2)


@pytest.mark.parametrize("save", [in_place, without_fsync, without_fsync_of_the_parent, drops_first])
def test_a_bad_saver_is_found_out(tmp_path, save):
    losses = [first_loss(save, tmp_path / str(loses_names), loses_names)[1] for loses_names in (False, True)]
    print(f"\n{save.__name__}: {' / '.join(losses)}")
    assert any(losses)
