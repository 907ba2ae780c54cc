"""Exports a trained policy: ``python -m warp_torchrl.export RUN FOLDER``.

The folder holds a checkpoint without its training state. It can be evaluated, loaded and shipped; no run resumes from
it.
"""

import argparse
import sys
from dataclasses import replace
from pathlib import Path

from warp_torchrl.api import policy_of
from warp_torchrl.config.saved_config import SavedConfig
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
        record = found.record()
        if options.trust is not None:
            record = _trusting(record, options.trust)
            policy_of(found, record=record)  # what cannot be trusted is told before anything is written
        checkpoints.export(found, options.folder, record)
    except (checkpoints.CheckpointError, OSError, ValueError) as error:
        parser.error(" ".join(str(error).split()))
    print(f"{options.folder}: {found.manifest.scenario}, {found.manifest.frames} frames, {found.manifest.mode}")


def _trusting(record: SavedConfig, trust: float) -> SavedConfig:
    """Return the record of a policy whose agents trust their adviser so much."""
    return replace(record, values={**record.values, "model": {**record.values["model"], "trust": trust}})


if __name__ == "__main__":
    main()
