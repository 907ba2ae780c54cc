"""Small matches, and a run folder that goes on training."""

import shutil
from dataclasses import replace
from pathlib import Path

import pytest

from warp_torchrl.live.match import Match, Setting
from warp_torchrl.runs import checkpoint as checkpoints
from warp_torchrl.runs.config.building import run_config
from warp_torchrl.runs.config.compose import compose_config, option_of
from warp_torchrl.runs.config.construction import COMPONENTS
from warp_torchrl.runs.config.plain_values import plain, without_targets
from warp_torchrl.runs.config.saved_config import SavedConfig
from warp_torchrl.runs.manifest import read_manifest, write_manifest
from warp_torchrl.runs.policies.find import find_policy
from warp_torchrl.training.loop import Training

SMALL = ("landscape.size=16", "team.n_agents=3", "horizon=30")


@pytest.fixture
def make_match():
    """Make a match on a small map; keywords of ``Setting``."""

    def make(policy="coordinated", overrides=(), **options):
        return Match(Setting(policy=policy, overrides=(*SMALL, *overrides), **options))

    return make


@pytest.fixture(scope="session")
def trained(tmp_path_factory):
    """The folder of a tiny run that was trained here, and goes on."""
    folder = tmp_path_factory.mktemp("trained")
    small = ("n_worlds=4", "collector.steps=8", "algorithm.minibatch_size=16", "model.actor_hidden=[16]")
    composed = compose_config("train", [*SMALL, *small, "model.critic_hidden=[16]", "total_frames=32"])
    config = plain(composed)
    kept = {key: value for key, value in without_targets(config).items() if key not in ("resume", "debug")}
    options = {group: option_of(group, config[group]["_target_"]) for group in COMPONENTS}
    record = SavedConfig(choices={"scenario": config["scenario"], **options}, values=kept)
    Training(run_config(config), record, folder).train()
    return folder


@pytest.fixture
def run_folder(tmp_path):
    """A run folder whose checkpoints are the shipped policy's, and a function that adds one of so many frames."""
    run = tmp_path / "run"

    def add(frames: int) -> Path:
        folder = run / "checkpoints" / str(frames)
        shutil.copytree(find_policy("skirmish"), folder)
        old = read_manifest(folder)
        write_manifest(folder, replace(old, frames=frames, history=()))
        return folder

    add(1000)
    assert checkpoints.newest(run)[0].manifest.frames == 1000
    return run, add
