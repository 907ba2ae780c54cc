"""One process at a time trains into a run folder."""

import pytest

from warp_torchrl.system.lock import RunFolderInUse, RunFolderLock


def test_a_run_folder_has_one_writer(tmp_path):
    run = tmp_path / "runs" / "of today"  # neither is there
    lock = RunFolderLock(run)
    with pytest.raises(RunFolderInUse, match="in use"):
        RunFolderLock(run)
    lock.release()
    RunFolderLock(run).release()
