"""Available memory of a process."""

import os
import resource
import sys
from collections.abc import Iterator
from contextlib import suppress
from pathlib import Path

_CGROUPS = (
    ("/sys/fs/cgroup", "memory.max", "memory.current"),
    ("/sys/fs/cgroup/memory", "memory.limit_in_bytes", "memory.usage_in_bytes"),
)
"""Where a container's limit and use stand, in the second and in the first version of control groups."""
_FILES = ("inactive_file ", "total_inactive_file ")
"""What a control group calls copies of files that it drops when memory is short."""


def available() -> int:
    """Return the bytes that this process may still use: the least of the machine's, container's and own limits."""
    return max(0, min(_limits()))


def most_used() -> int:
    """Return the most bytes of memory that this process has had at once since it began."""
    with suppress(OSError, ValueError, IndexError, StopIteration):  # of this program alone, not of what started it
        lines = Path("/proc/self/status").read_text().splitlines()
        return 1024 * int(next(line for line in lines if line.startswith("VmHWM:")).split()[1])
    return resource.getrusage(resource.RUSAGE_SELF).ru_maxrss * (1 if sys.platform == "darwin" else 1024)


def too_little(what: str, wanted: float, there: float) -> ValueError:
    """Return the error of something that does not fit in memory, in one line.

    Args:
        what: What wants it.
        wanted: How much [bytes].
        there: How much there is [bytes].
    """
    return ValueError(
        f"memory must hold {what}, which wants {wanted / 1e9:.1f} GB, got {there / 1e9:.1f} GB: "
        f"take a smaller map or window of it (landscape.size, row, column), fewer hours or fewer fires"
    )


def _limits() -> Iterator[int]:
    yield _of_machine()
    for folder, limit, used in _CGROUPS:
        with suppress(OSError, ValueError):  # no such group, or one without a limit, which says "max"
            yield int(Path(folder, limit).read_text()) - int(Path(folder, used).read_text()) + _dropped(Path(folder))
    most = resource.getrlimit(resource.RLIMIT_AS)[0]
    if most != resource.RLIM_INFINITY:
        yield most - _address_space()


def _of_machine() -> int:
    """Return the machine's free and reclaimable memory; half of its memory where it does not say."""
    with suppress(OSError, ValueError, IndexError):
        lines = Path("/proc/meminfo").read_text().splitlines()
        return 1024 * int(next(line for line in lines if line.startswith("MemAvailable:")).split()[1])
    return os.sysconf("SC_PAGE_SIZE") * os.sysconf("SC_PHYS_PAGES") // 2


def _dropped(group: Path) -> int:
    lines = (group / "memory.stat").read_text().splitlines()
    return max((int(line.split()[1]) for line in lines if line.startswith(_FILES)), default=0)


def _address_space() -> int:
    with suppress(OSError, ValueError, IndexError):
        return int(Path("/proc/self/statm").read_text().split()[0]) * os.sysconf("SC_PAGE_SIZE")
    return 0
