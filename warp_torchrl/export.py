"""Exports a trained policy: ``python -m warp_torchrl.export RUN FOLDER``.

The folder holds a checkpoint without its training state. It can be evaluated, loaded and shipped; no run resumes from
it.
"""

import argparse
import shutil
import sys
from pathlib import Path

from warp_torchrl.api import load_policy
from warp_torchrl.runs import checkpoint as checkpoints
from warp_torchrl.runs.shipped import find_policy


def main(arguments: list[str] | None = None) -> None:
    """Export the policy of the run or checkpoint that the command line names."""
    parser = argparse.ArgumentParser(prog="python -m warp_torchrl.export", description=__doc__)
    told = "a run folder (its newest sound checkpoint), one of them, or the name of a shipped policy"
    parser.add_argument("run", metavar="RUN", help=told)
    parser.add_argument("folder", type=Path, metavar="FOLDER", help="what to make")
    parser.add_argument("--trust", type=float, help="how much its agents trust their adviser from now on, model.trust")
    options = parser.parse_args(arguments)
    try:
        found, skipped = checkpoints.newest(find_policy(options.run))
        for line in skipped:
            print(f"skipped: {line}", file=sys.stderr)
        checkpoints.export(found, options.folder, options.trust)
        if options.trust is not None:
            _check(options.folder)
    except (checkpoints.CheckpointError, OSError, ValueError) as error:
        parser.error(" ".join(str(error).split()))
    print(f"{options.folder}: {found.manifest.scenario}, {found.manifest.frames} frames, {found.manifest.mode}")


def _check(folder: Path) -> None:
    """Check that an exported policy can be loaded; else take its folder away.

    Raises:
        CheckpointError: If it does not fit what it was trained to see.
        ValueError: If a value is out of its range.
    """
    try:
        load_policy(folder)
    except (checkpoints.CheckpointError, ValueError):
        shutil.rmtree(folder)
        raise


if __name__ == "__main__":
    main()
