"""The power is cut before every file-system call of a save: what was there stays, or the new one is whole."""

import shutil
from contextlib import nullcontext

import pytest

from tests.runs.test_checkpoint import saved
from tests.stress.power import with_power_cut
from tests.stress.saves import KINDS, left
from warp_torchrl.demonstrations import files
from warp_torchrl.runs import checkpoint as checkpoints
from warp_torchrl.runs import output
from warp_torchrl.system.checksummed import Unsound

pytestmark = pytest.mark.stress


def first_loss(kind, save, folder, loses_names):
    """Cut the power before each call in turn; return the calls that were survived, and what was lost at the next."""
    kind.save(folder / "before", 1)
    kind.save(folder / "before", 2)
    there = folder / "there"
    for call in range(1000):
        shutil.rmtree(there, ignore_errors=True)
        shutil.copytree(folder / "before", there)
        returned = with_power_cut(lambda: save(there), there, call, loses_names)
        try:
            found = kind.held(there)
        except (Unsound, AssertionError) as error:
            return call, str(error)
        if not {2} <= found <= {1, 2, 3}:
            return call, f"{found} are there"
        if returned:
            return call, "" if 3 in found else "a save that had returned is gone"
        kind.save(there, 4)
        if 4 not in kind.held(there) or left(there):
            return call, f"the next save leaves {left(there)}"
    raise AssertionError("a save that never returns")


@pytest.mark.parametrize("loses_names", [False, True])
@pytest.mark.parametrize("kind", KINDS.values(), ids=KINDS)
def test_no_power_cut_costs_what_was_saved(tmp_path, kind, loses_names):
    survived, loss = first_loss(kind, lambda folder: kind.save(folder, 3), tmp_path, loses_names)
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


def recorded_in_place(people):
    """Write a recording without a draft."""
    files.publish = lambda draft, parent, names: draft
    files.draft_in = lambda parent: nullcontext(made(parent / "skirmish-3-1"))
    KINDS["recording"].save(people, 3)


def made(folder):
    folder.mkdir()
    return folder


def recorded_without_fsync(people):
    """Trust the operating system to write mapped memory soon."""
    output.sync_all = lambda folder: None
    KINDS["recording"].save(people, 3)


BAD = {
    "checkpoint": (in_place, without_fsync, without_fsync_of_the_parent, drops_first),
    "recording": (recorded_in_place, recorded_without_fsync),
}


@pytest.mark.parametrize(("name", "save"), [(name, save) for name, saves in BAD.items() for save in saves])
def test_a_bad_saver_is_found_out(tmp_path, name, save):
    losses = [first_loss(KINDS[name], save, tmp_path / str(lost), lost)[1] for lost in (False, True)]
    print(f"\n{save.__name__}: {' / '.join(losses)}")
    assert any(losses)
