"""A training that ends with what started it."""

import os
import signal
import sys
import time

from warp_torchrl.commands import trial


def test_it_trains_until_its_input_closes_and_then_as_by_a_signal(monkeypatch):
    reader, writer = os.pipe()
    monkeypatch.setattr(sys, "stdin", os.fdopen(reader))
    received = []

    def train():
        time.sleep(0.05)
        assert not received, "its input is open"
        os.close(writer)
        end = time.monotonic() + 20.0
        while not received and time.monotonic() < end:
            time.sleep(0.005)

    monkeypatch.setattr(trial, "train", train)
    before = signal.signal(signal.SIGTERM, lambda number, _: received.append(number))
    try:
        trial.main()
    finally:
        signal.signal(signal.SIGTERM, before)
    assert received == [signal.SIGTERM]
