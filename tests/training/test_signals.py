"""The first signal is noted while a run can save, a second one and any other ends the process at once."""

import os
import signal
from pathlib import Path

import pytest

from warp_torchrl.training.signals import DeferredSignals, Stopped, exit_on_signal

SIGNALS = (signal.SIGTERM, signal.SIGINT, signal.SIGUSR1)


def send(number):
    os.kill(os.getpid(), number)


@pytest.mark.parametrize("number", SIGNALS)
def test_a_signal_is_noted_and_a_second_one_exits_at_once(number, capfd):
    before = signal.getsignal(number)
    with DeferredSignals() as signals:
        send(number)
        assert signals.received == number and not capfd.readouterr().err
        with pytest.raises(SystemExit) as end:
            send(signal.SIGTERM)
    assert end.value.code == 128 + signal.SIGTERM and signal.getsignal(number) is before
    assert capfd.readouterr().err == "error: stopped by signal SIGTERM\n"


@pytest.mark.parametrize("number", SIGNALS)
def test_a_signal_is_obeyed_at_once_elsewhere(number, capfd):
    before = signal.getsignal(number)
    with pytest.raises(SystemExit) as end, exit_on_signal():
        send(number)
    assert end.value.code == 128 + number and signal.getsignal(number) is before
    assert capfd.readouterr().err == f"error: stopped by signal {number.name}\n"


def test_noting_ends_where_obeying_goes_on():
    with pytest.raises(SystemExit), exit_on_signal():
        with DeferredSignals():
            pass
        send(signal.SIGUSR1)


def test_what_is_said_names_the_signal_and_the_way_on():
    assert str(Stopped(signal.SIGTERM, Path("run"))) == "stopped by signal SIGTERM; go on with resume=run"
