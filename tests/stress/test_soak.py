"""Minutes of training and evaluation: memory, descriptors and threads stay as they are."""

import gc
import os
import threading
import time
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from tests.training.test_loop import RUNS, tiny
from warp_torchrl import load_policy
from warp_torchrl.evaluation.play import play

pytestmark = pytest.mark.stress
MINUTES = float(os.environ.get("WARP_SOAK_MINUTES", "10"))
WARM_UP = 0.3  # of the time, in which allocators and replay memories fill


def sample():
    """Resident memory [MB], open descriptors, threads."""
    gc.collect()
    pages = int(Path("/proc/self/statm").read_text().split()[1])
    return (
        pages * os.sysconf("SC_PAGE_SIZE") / 1e6,
        len(list(Path("/proc/self/fd").iterdir())),
        threading.active_count(),
    )


def test_nothing_grows(tmp_path):
    start, times, samples, frames = time.monotonic(), [], [], 0
    runs = {
        name: tiny(tmp_path / name, *RUNS[name], "total_frames=1000000000", "checkpoint.interval=1000000000")
        for name in ("mappo", "dqn")
    }
    for name, run in runs.items():
        run.saved_config = replace(run.saved_config, choices={"algorithm": name})
        run.run.mkdir()
    batches = {name: iter(run.collection) for name, run in runs.items()}
    while (minutes := (time.monotonic() - start) / 60) < MINUTES:
        for name, run in runs.items():
            for _ in range(10):
                row = run._learn([next(batches[name])])
                run.metrics.add({"time/frames": run.frames, **row})
            run.save()
            policy = load_policy(run.run)
            play(run.run_config.make_env(4, 1_000_000), policy, 1_000_000, policy.mode)
            frames += 320
            assert len(list((run.run / "checkpoints").iterdir())) <= run.run_config.checkpoint.keep
        times.append(minutes)
        samples.append(sample())
    memory, descriptors, threads = (np.array(each) for each in zip(*samples))
    late = np.array(times) > WARM_UP * MINUTES
    slope = np.polyfit(np.array(times)[late], memory[late], 1)[0]
    print(
        f"\nsoak of {MINUTES:g} minutes, {frames} frames, {2 * len(times)} saves and evaluations: "
        f"memory {memory[late][0]:.1f} to {memory[-1]:.1f} MB, {slope:+.2f} MB a minute; "
        f"descriptors {descriptors[late].min()}..{descriptors[late].max()}, "
        f"threads {threads[late].min()}..{threads[late].max()}"
    )
    assert slope < 1.0
    assert descriptors[-1] <= descriptors[late][0] and threads[-1] <= threads[late][0]
