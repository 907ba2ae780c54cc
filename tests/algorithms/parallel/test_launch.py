"""The start of processes that learn together."""

import subprocess
import threading
from types import SimpleNamespace

import pytest
import torch

from tests.algorithms.parallel.other import addresses
from warp_torchrl.algorithms import parallel
from warp_torchrl.algorithms.parallel import launch, torchrun
from warp_torchrl.algorithms.parallel.messages import MOST_BYTES, deserialised, message_header, serialised
from warp_torchrl.algorithms.parallel.sockets import Sockets, pairs


def test_processes_that_learn_together_can_be_reached_by_nobody_else():
    before = addresses()
    with parallel.processes(2, {"seed": 3}, "tests.algorithms.parallel.other"):
        own, (told, others) = parallel.gather(addresses())
    assert told == {"seed": 3}
    assert own == before and others == [], "an internet socket, or one that has a name"
    assert parallel.size() == 1


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
        untold = threading.Lock()  # cannot be packed, and need not be: there is nobody to be told
        assert parallel.share(untold) is untold


def test_those_that_have_ended_are_named_with_how(monkeypatch):
    monkeypatch.setattr(launch, "_SECONDS_TO_BREAK", 0.2)
    ends = ("kill -9 $$", "exit 3", "exit 0", "exec sleep 60")
    others = [subprocess.Popen(["sh", "-c", each]) for each in ends]
    for each in others[:3]:
        each.wait()
    told = launch._ended(others)
    others[3].kill()
    others[3].wait()
    assert told == "a process of the run has ended: process 1 by signal 9, process 2 by exit code 3"


def test_under_torchrun_messages_go_to_the_first_process(monkeypatch):
    sent = {0: []}
    fake = SimpleNamespace(
        send=lambda tensor, to: sent[to].append(tensor),
        recv=lambda place, rank: place.copy_(sent[0].pop(0)),
    )
    monkeypatch.setattr(torchrun, "dist", fake)
    first, second = object.__new__(torchrun.Torchrun), object.__new__(torchrun.Torchrun)
    (first.rank, first.size), (second.rank, second.size) = (0, 2), (1, 2)
    assert second.gather(memoryview(b"from the second")) == []
    assert [bytes(each) for each in first.gather(memoryview(b"own"))] == [b"own", b"from the second"]


class Payload:
    def __reduce__(self):
        return pytest.fail, ("it was executed",)


def test_what_is_received_is_never_executed():
    assert deserialised(serialised({"a": [1, None, (2.0, "b")]})) == {"a": [1, None, (2.0, "b")]}
    with pytest.raises(Exception, match="Weights only load failed"):
        deserialised(serialised({"a": Payload()}))


@pytest.mark.parametrize(
    ("sent", "line"),
    [
        (message_header(MOST_BYTES + 1), "a message must have at most"),
        (message_header(12) + bytes(12), "a message must have 8 bytes here, got 12"),
        (message_header(8) + bytes(4), "the connection is closed"),
        (b"", "the connection is closed"),
    ],
    ids=["too large", "of another size", "cut", "none"],
)
def test_a_message_that_does_not_fit_ends_the_run_with_a_line(sent, line):
    (own,), (given,) = pairs(1)
    given.sendall(sent)
    given.shutdown(1)
    with pytest.raises((RuntimeError, OSError), match=line):
        Sockets(0, 2, [own]).sum_(torch.zeros(2))


def test_sums_are_of_three_in_the_order_of_their_numbers_whatever_the_layout():
    own, given = pairs(2)
    tensors = [torch.full((2, 3), value).T for value in (1e8, -1e8, 0.1)]
    groups = [Sockets(0, 3, own), *(Sockets(rank, 3, [end]) for rank, end in enumerate(given, start=1))]
    threads = [threading.Thread(target=each.sum_, args=(part,)) for each, part in zip(groups, tensors, strict=True)]
    for each in threads:
        each.start()
    for each in threads:
        each.join(10)
    assert all(torch.equal(each, torch.full((3, 2), 0.1)) for each in tensors)
