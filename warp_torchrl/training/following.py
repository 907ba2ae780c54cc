"""Work of the other processes of a training: they learn with the first one, which alone writes files."""

import logging
import os
import sys
from pathlib import Path
from typing import Any

import torch

from warp_torchrl.algorithms import parallel
from warp_torchrl.runs.config.building import run_config
from warp_torchrl.runs.config.plugins import load
from warp_torchrl.runs.config.saved_config import SavedConfig
from warp_torchrl.system.malloc import keep_freed_memory
from warp_torchrl.system.signals import DeferredSignals, Stopped
from warp_torchrl.training.finite import NumericalFailure
from warp_torchrl.training.loop import Training

FOLLOWING = "warp_torchrl.training.following"
"""The module that another process runs."""


def follow_training(values: dict[str, Any]) -> None:
    """Train as one of the other processes, with the first one's configuration, until it ends.

    The first process reports what stops the run.
    """
    keep_freed_memory()
    for name in ("warp_torchrl", "torchrl"):
        logging.getLogger(name).setLevel(logging.ERROR)
    if torch.device(values["device"]).type == "cuda":
        place = int(os.environ.get("LOCAL_RANK", parallel.rank()))
        values = {**values, "device": f"cuda:{place % torch.cuda.device_count()}"}
    load(values["plugins"])
    training = Training(run_config(values), SavedConfig(), Path())
    try:
        with DeferredSignals() as signals:  # a terminal sends its signals to every process
            training.train(signals)
    except (NumericalFailure, Stopped):
        pass
    finally:
        training.close()


if __name__ == "__main__":
    parallel.join(sys.argv[1:], follow_training)
