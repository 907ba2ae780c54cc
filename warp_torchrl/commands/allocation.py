"""Memory that is freed and soon asked for again stays with the process, where the C library can be told so."""

import ctypes
import sys

_TRIM_THRESHOLD, _MMAP_THRESHOLD = -1, -3  # M_TRIM_THRESHOLD, M_MMAP_THRESHOLD of glibc's malloc.h
_LARGEST = 2**31 - 1
_LARGE = 2**30  # blocks from here on go back to the system as ever [bytes]


def keep_freed_memory() -> bool:
    """Tell glibc to keep what is freed, and return whether it does so from now on.

    By default it gives large blocks back to the system and gets them anew, page by page: training on CPUs does so with
    every minibatch. The process may stay as large as it once was. The commands ask for it; the library leaves its
    user's process as it is.
    """
    if not sys.platform.startswith("linux"):
        return False
    try:
        mallopt = ctypes.CDLL(None).mallopt
    except (OSError, AttributeError):  # another C library
        return False
    return bool(mallopt(_MMAP_THRESHOLD, _LARGE)) and bool(mallopt(_TRIM_THRESHOLD, _LARGEST))
