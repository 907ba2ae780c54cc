"""How the process waits and keeps memory: it is told when this is imported, which must be before torch is.

What the user has set stays.
"""

import ctypes
import os

_TRIM_THRESHOLD, _MMAP_THRESHOLD = -1, -3  # of mallopt, in malloc.h
_KEPT = 2**30  # bytes
_LARGEST = 2**25  # bytes; glibc takes no more


def spin_shortly() -> None:
    """Let GNU OpenMP's waiting threads spin for a short while only.

    By default they spin for milliseconds: beside any other load on the machine a step of small tensors was seen to take
    30 times as long. A short spin costs next to nothing on a free machine and keeps most of the speed on a busy one.
    """
    if "OMP_WAIT_POLICY" not in os.environ:
        os.environ.setdefault("GOMP_SPINCOUNT", "1000")


def keep_memory() -> None:
    """Keep up to a gigabyte that was freed, where the C library is glibc.

    Else it goes back to the system when a step ends, and the next step fetches it page by page: up to a seventh of a
    step's time.
    """
    own = {"MALLOC_TRIM_THRESHOLD_", "MALLOC_MMAP_THRESHOLD_", "MALLOC_TOP_PAD_", "GLIBC_TUNABLES"}
    mallopt = getattr(ctypes.CDLL(None), "mallopt", None) if os.name == "posix" else None
    if mallopt is None or own & os.environ.keys():
        return
    mallopt(_TRIM_THRESHOLD, _KEPT)
    mallopt(_MMAP_THRESHOLD, _LARGEST)


spin_shortly()
keep_memory()
