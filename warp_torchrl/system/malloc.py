"""Settings of the C library's memory allocator."""

import ctypes
import sys

_TRIM_THRESHOLD, _MMAP_THRESHOLD = -1, -3  # M_TRIM_THRESHOLD, M_MMAP_THRESHOLD of glibc's malloc.h
_LARGEST = 2**31 - 1
_LARGE = 2**30  # larger blocks still go back to the system [bytes]


def keep_freed_memory() -> bool:
    """Let glibc keep freed memory for reuse, and return whether it will.

    By default glibc returns large blocks to the system and gets them again page by page; training on CPUs does this
    with every minibatch. The process may then stay at its largest size. Only the commands call this, not the library.
    """
    if not sys.platform.startswith("linux"):
        return False
    try:
        mallopt = ctypes.CDLL(None).mallopt
    except (OSError, AttributeError):  # another C library
        return False
    return bool(mallopt(_MMAP_THRESHOLD, _LARGE)) and bool(mallopt(_TRIM_THRESHOLD, _LARGEST))
