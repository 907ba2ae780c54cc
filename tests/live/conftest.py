"""Small matches, and a run folder that goes on training."""

import shutil
from pathlib import Path

import pytest

from warp_torchrl.live.match import Match, Setting
from warp_torchrl.runs import checkpoint as checkpoints
from warp_torchrl.runs.manifest import read_manifest, write_manifest
from warp_torchrl.runs.shipped import find_policy

SMALL = ("landscape.size=16", "team.n_agents=3", "horizon=30")


@pytest.fixture
def make_match():
    """Make a match on a small map; keywords of ``Setting``."""

    def make(policy="coordinated", overrides=(), **options):
        return Match(Setting(policy=policy, overrides=(*SMALL, *overrides), **options))

    return make


@pytest.fixture
def run_folder(tmp_path):
    """A run folder whose checkpoints are the shipped policy's, and a function that adds one of so many frames."""
    run = tmp_path / "run"

    def add(frames: int) -> Path:
        folder = run / "checkpoints" / str(frames)
        shutil.copytree(find_policy("skirmish"), folder)
        old = read_manifest(folder)
        write_manifest(folder, frames, old.scenario, old.signature, old.mode)
        return folder

    add(1000)
    assert checkpoints.newest(run)[0].manifest.frames == 1000
    return run, add
