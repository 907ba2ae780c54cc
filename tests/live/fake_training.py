"""A training that takes no time: it writes a row and a checkpoint, and goes on until it is asked to save and end.

It ends as a training does, by SIGTERM. Of 1 step it ends at once, of 2 it fails.
"""

import signal
import sys
import threading
from pathlib import Path


def main() -> None:
    assert sys.argv[1] == "train"
    given = dict(each.split("=", 1) for each in sys.argv[2:])
    folder, total = Path(given["hydra.run.dir"]), int(given["total_frames"])
    (folder / "arguments.txt").write_text("\n".join(sys.argv[2:]))
    if total == 2:
        sys.exit("error: the disk is full")
    (folder / "metrics.csv").write_text("time/frames,world/saved\n1000,\n2000,0.75\n3000,0.")
    (folder / "checkpoints").mkdir()
    (folder / "checkpoints" / "2000").mkdir()
    if total > 1:
        ended = threading.Event()
        signal.signal(signal.SIGTERM, lambda *_: ended.set())
        ended.wait(60)
        (folder / "saved.txt").write_text("all of it")
        sys.exit(128 + signal.SIGTERM)


if __name__ == "__main__":
    main()
