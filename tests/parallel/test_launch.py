"""The start of processes that learn together."""

import pytest
import torch

from warp_torchrl import parallel


@pytest.mark.slow
def test_a_process_that_ends_before_it_is_there_is_told_at_once():
    threads = torch.get_num_threads()
    with (
        pytest.raises(parallel.WorkerDied, match="a process of the run has ended: process 1 by exit code 1"),
        parallel.processes(2, {}, "warp_torchrl.no_such_module"),
    ):
        pytest.fail("the other process is not there")
    assert parallel.size() == 1 and torch.get_num_threads() == threads


def test_one_process_starts_no_other():
    with parallel.processes(1, {}, "warp_torchrl.no_such_module"):
        assert parallel.size() == 1
