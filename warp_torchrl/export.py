"""Exports a trained policy: ``python -m warp_torchrl.export RUN FOLDER``.

The folder holds a checkpoint without its training state. It can be evaluated, loaded and shipped; no run resumes from
it.
"""

import argparse
import sys
from pathlib import Path

from warp_torchrl.runs import checkpoint as checkpoints


def main(arguments: list[str] | None = None) -> None:
    """Export the policy of the run or checkpoint that the command line names."""
    parser = argparse.ArgumentParser(prog="python -m warp_torchrl.export", description=__doc__)
    parser.add_argument(
        "run", type=Path, metavar="RUN", help="a run folder (its newest sound checkpoint), or one of them"
    )
    parser.add_argument("folder", type=Path, metavar="FOLDER", help="what to make")
    options = parser.parse_args(arguments)
    try:
        found, skipped = checkpoints.newest(options.run)
        for line in skipped:
            print(f"skipped: {line}", file=sys.stderr)
        checkpoints.export(found, options.folder)
    except (checkpoints.CheckpointError, OSError) as error:
        parser.error(" ".join(str(error).split()))
    print(f"{options.folder}: {found.manifest.scenario}, {found.manifest.frames} frames, {found.manifest.mode}")


if __name__ == "__main__":
    main()
