"""Memory that is freed stays with the process."""

import subprocess
import sys

import pytest

from warp_torchrl.system import malloc
from warp_torchrl.system.malloc import keep_freed_memory

FAULTS = """
import resource, runpy

kept = {asked} and runpy.run_path({path!r})["keep_freed_memory"]()

def faults():
    before = resource.getrusage(resource.RUSAGE_SELF).ru_minflt
    for _ in range(20):
        b"x" * 64_000_000
    return resource.getrusage(resource.RUSAGE_SELF).ru_minflt - before

faults()
print(kept, faults())
"""


def pages_asked_for(asked):
    command = [sys.executable, "-c", FAULTS.format(asked=asked, path=malloc.__file__)]
    kept, faults = subprocess.run(command, capture_output=True, text=True, check=True).stdout.split()
    return kept == "True", int(faults)


@pytest.mark.slow
def test_freed_memory_is_used_again():
    kept, few = pages_asked_for(True)
    if not kept:
        pytest.skip("the C library is not glibc")
    _, many = pages_asked_for(False)
    assert few < 100 < 1000 < many, (few, many)


def test_elsewhere_nothing_is_done(monkeypatch):
    monkeypatch.setattr(sys, "platform", "darwin")
    assert keep_freed_memory() is False
    monkeypatch.setattr(sys, "platform", "linux")
    monkeypatch.setattr("ctypes.CDLL", lambda name: object())
    assert keep_freed_memory() is False
