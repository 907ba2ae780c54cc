"""The first signal is noted while a run can save, a second one and any other ends the process at once."""

import os
import signal
from contextlib import suppress
from pathlib import Path
from threading import Event

import pytest

from warp_torchrl.system import signals
from warp_torchrl.system.signals import DeferredSignals, Stopped, exit_on_signal, watched

SIGNALS = (signal.SIGTERM, signal.SIGINT, signal.SIGHUP, signal.SIGUSR1, signal.SIGUSR2)


def send(number):
    os.kill(os.getpid(), number)


@pytest.mark.parametrize("number", SIGNALS)
def test_a_signal_is_noted_and_a_second_one_exits_at_once(number, capfd):
    before = signal.getsignal(number)
    with DeferredSignals() as noted:
        send(number)
        assert noted.received == number and not capfd.readouterr().err
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


def test_the_signal_that_submitit_is_told_to_warn_by_is_noted_too(monkeypatch):
    monkeypatch.setenv("SUBMITIT_PREEMPT_SIGNAL", "ALRM")
    with DeferredSignals() as noted:
        send(signal.SIGALRM)
    assert noted.received == signal.SIGALRM
    monkeypatch.setenv("SUBMITIT_PREEMPT_SIGNAL", "NONSENSE")
    assert set(watched()) == set(SIGNALS)


def test_what_nohup_ignores_stays_ignored():
    before = signal.signal(signal.SIGHUP, signal.SIG_IGN)
    try:
        with exit_on_signal(), DeferredSignals() as noted:
            send(signal.SIGHUP)
            assert not noted.received
        assert signal.getsignal(signal.SIGHUP) == signal.SIG_IGN
    finally:
        signal.signal(signal.SIGHUP, before)


def test_a_command_whose_signal_a_library_has_caught_ends_all_the_same(monkeypatch, capfd):
    ended = Event()
    monkeypatch.setattr(signals, "_SECONDS_TO_END", 0.01)
    monkeypatch.setattr(os, "_exit", lambda code: ended.set() or codes.append(code))
    codes = []
    with exit_on_signal():
        with suppress(SystemExit):
            send(signal.SIGTERM)
        assert ended.wait(5.0) and codes == [143] and signals.left_by() == signal.SIGTERM
    monkeypatch.setattr(signals, "_SECONDS_TO_END", 60.0)
    with suppress(SystemExit), exit_on_signal():
        send(signal.SIGTERM)
    assert signals._left.clock is None, "a command that has ended would be ended"


def test_what_is_said_names_the_signal_and_the_way_on():
    assert str(Stopped(signal.SIGTERM, Path("run"))) == "stopped by signal SIGTERM; go on with resume=run"
