"""A process that learns nothing, for tests: it tells what it can be reached by."""

import sys
from pathlib import Path

from warp_torchrl.algorithms import parallel


def addresses():
    """The internet sockets of this process, and the names of its others, as the kernel lists them."""
    own = {link for path in Path("/proc/self/fd").iterdir() if (link := linked(path)).startswith("socket:")}
    inodes = {each.removeprefix("socket:[").removesuffix("]") for each in own}
    found = []
    for kind in ("tcp", "tcp6", "udp", "udp6"):
        rows = [row.split() for row in Path(f"/proc/net/{kind}").read_text().splitlines()[1:]]
        found += [f"{kind} {row[1]}" for row in rows if row[9] in inodes]
    rows = [row.split() for row in Path("/proc/net/unix").read_text().splitlines()[1:]]
    return found + [row[7] for row in rows if row[6] in inodes and len(row) > 7]


def linked(path):
    try:
        return str(path.readlink())
    except OSError:  # of the listing itself
        return ""


if __name__ == "__main__":
    parallel.join(sys.argv[1:], lambda values: parallel.gather([values, addresses()]))
