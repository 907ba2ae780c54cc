"""What a queue's warning does to a job of a sweep: it saves, and the queue starts it again."""

import os
import signal

import pytest

from warp_torchrl.commands.queue import Ended, queued
from warp_torchrl.system.signals import Stopped


class Submitit:
    """What submitit does at its warning: it ends the process to have the job queued again, or says that it cannot."""

    def __init__(self, monkeypatch, warning=signal.SIGUSR2, ends=None):
        self.warning, self.ends, self.codes = warning, ends or SystemExit(144), []
        monkeypatch.setenv("SUBMITIT_EXECUTOR", "local")
        if warning != signal.SIGUSR2:
            monkeypatch.setenv("SUBMITIT_PREEMPT_SIGNAL", warning.name.removeprefix("SIG"))
        monkeypatch.setattr(os, "_exit", self.codes.append)

    def __enter__(self):
        self._before = signal.signal(self.warning, self._obey)
        return self

    def __exit__(self, *error):
        signal.signal(self.warning, self._before)

    def _obey(self, number, frame):
        raise self.ends


@pytest.mark.parametrize("warning", [signal.SIGUSR2, signal.SIGUSR1])
def test_a_run_that_has_saved_at_the_warning_is_queued_again(monkeypatch, tmp_path, warning):
    with Submitit(monkeypatch, warning) as submitit, queued() as queue:
        queue.start_again(Stopped(signal.SIGTERM, tmp_path))
        assert not submitit.codes
        queue.start_again(Stopped(warning, tmp_path))
        assert submitit.codes == [144]


def test_a_job_that_has_not_saved_is_queued_again_out_of_whatever_it_does(monkeypatch):
    with Submitit(monkeypatch) as submitit:
        with queued():
            os.kill(os.getpid(), signal.SIGUSR2)  # nothing is raised where it was
        assert submitit.codes == [144] and signal.getsignal(signal.SIGUSR2) == submitit._obey


def test_a_job_that_was_queued_too_often_ends_with_its_own_line(monkeypatch, tmp_path):
    with Submitit(monkeypatch, ends=RuntimeError("timed-out too many times")), queued() as queue:
        stopped = Stopped(signal.SIGUSR2, tmp_path)
        queue.start_again(stopped)
        with pytest.raises(RuntimeError):
            os.kill(os.getpid(), signal.SIGUSR2)
        told = queue.explain(ValueError("Converting a tensordict to boolean value is not permitted"))
    assert isinstance(told, Ended) and str(told) == "stopped by signal SIGUSR2; go on with the same command line"


def test_without_a_queue_nothing_is_watched(monkeypatch, tmp_path):
    monkeypatch.delenv("SUBMITIT_EXECUTOR", raising=False)
    before = signal.getsignal(signal.SIGUSR2)
    with queued() as queue:
        assert signal.getsignal(signal.SIGUSR2) == before
        error = Stopped(signal.SIGUSR2, tmp_path)
        queue.start_again(error)
        assert queue.explain(error) is error
