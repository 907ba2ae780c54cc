"""Where a program would wait for a GPU is told, and nothing else."""

import pytest
import torch

from warp_torchrl.benchmark.waits import counted_waits
from warp_torchrl.system.device import needs_no_sync, unread

NUMBERS = torch.arange(6.0)
MASK = NUMBERS > 2.0
CPU = torch.device("cpu")


@pytest.mark.parametrize(
    "ask",
    [
        lambda: NUMBERS[0].item(),
        lambda: float(NUMBERS[0]),
        lambda: bool(MASK.all()),
        lambda: NUMBERS.tolist(),
        lambda: NUMBERS.numpy(),
        lambda: MASK.nonzero(),
        lambda: NUMBERS[MASK],
        lambda: NUMBERS.masked_select(MASK),
        lambda: NUMBERS.clone().__setitem__(MASK, torch.zeros(3)),
        lambda: NUMBERS.unique(),
        lambda: torch.equal(NUMBERS, NUMBERS),
        lambda: torch.repeat_interleave(NUMBERS, MASK.long()),
        lambda: torch.tensor([1, 2], device=CPU),
        lambda: NUMBERS[[1, 2]],
        lambda: torch.nn.functional.one_hot(MASK.long()),
    ],
)
def test_what_reads_or_has_a_size_that_results_decide_is_a_wait(ask):
    with counted_waits(CPU) as waits:
        ask()
    assert waits.count >= 1


@pytest.mark.parametrize(
    "compute",
    [
        lambda: torch.where(MASK, NUMBERS, 0.0).sum(),
        lambda: NUMBERS.clone().masked_fill_(MASK, 1.0),
        lambda: NUMBERS.clone().__setitem__(MASK, 0.0),
        lambda: NUMBERS.index_select(0, torch.arange(3)),
        lambda: NUMBERS[torch.arange(3)],
        lambda: NUMBERS[1:3],
        lambda: torch.nn.functional.one_hot(MASK.long(), 2),
        lambda: torch.tensor([1, 2]),
        lambda: torch.repeat_interleave(NUMBERS, MASK.long(), output_size=3),
        lambda: NUMBERS.sort().values,
    ],
)
def test_what_a_gpu_computes_by_itself_is_none(compute):
    with counted_waits(CPU) as waits:
        compute()
    assert not waits.places


def test_a_cpu_is_read_unless_it_stands_for_a_gpu():
    assert needs_no_sync(CPU) and not needs_no_sync(torch.device("cuda"))
    with unread():
        assert not needs_no_sync(CPU)
    assert needs_no_sync(CPU)
