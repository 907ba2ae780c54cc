"""What the package tells its process, seen from fresh processes."""

import ctypes
import os
import subprocess
import sys

import pytest

_GLIBC = os.name == "posix" and hasattr(ctypes.CDLL(None), "mallopt")
_FAULTS = """
import resource
import warp_torchrl
import torch

def step():
    planes = [torch.ones(2**20) for _ in range(8)]

for _ in range(5):
    step()
before = resource.getrusage(resource.RUSAGE_SELF).ru_minflt
for _ in range(20):
    step()
print((resource.getrusage(resource.RUSAGE_SELF).ru_minflt - before) / 20)
"""


def told(code: str, **settings: str) -> str:
    """What a fresh process prints."""
    own = ("OMP_WAIT_POLICY", "GOMP_SPINCOUNT", "GLIBC_TUNABLES")
    environment = {name: each for name, each in os.environ.items() if name not in own and "MALLOC" not in name}
    run = subprocess.run(
        [sys.executable, "-c", code], env=environment | settings, capture_output=True, text=True, check=True
    )
    return run.stdout.strip()


@pytest.mark.skipif(not _GLIBC, reason="the C library is not glibc")
def test_what_a_step_frees_is_kept_for_the_next():
    pages = 8 * 2**22 // 4096  # of a step's planes
    assert float(told(_FAULTS)) < 0.01 * pages
    assert float(told(_FAULTS, MALLOC_TRIM_THRESHOLD_="131072")) > 0.5 * pages  # the user's own setting stays


def test_threads_spin_shortly_unless_the_user_has_said_how_they_wait():
    code = "import os, warp_torchrl; print(os.environ.get('GOMP_SPINCOUNT'))"
    assert told(code) == "1000"
    assert told(code, GOMP_SPINCOUNT="7") == "7"
    assert told(code, OMP_WAIT_POLICY="passive") == "None"
