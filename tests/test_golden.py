"""The checkpoints of every release load, act and go on as they did; one of an unknown format is refused by name."""

import json
import shutil
from pathlib import Path

import pytest
import torch

from tests.forgery import forge
from warp_torchrl import load_policy, make_env
from warp_torchrl.evaluation.play import play
from warp_torchrl.models import ACTION
from warp_torchrl.runs.checkpoint import CheckpointError, newest
from warp_torchrl.runs.config.building import run_config
from warp_torchrl.runs.config.plain_values import plain
from warp_torchrl.runs.config.saved_config import restore
from warp_torchrl.training.loop import Training

GOLDEN = Path(__file__).parent / "golden"
RELEASES = sorted(path.name for path in GOLDEN.iterdir() if path.is_dir())


def found_now(release):
    """What a golden policy does on four fires."""
    run = GOLDEN / release
    plan = run_config(plain(restore(newest(run)[0].saved_config())))
    policy, env = load_policy(run), plan.make_env(plan.evaluation.episodes, plan.evaluation.first_seed)
    episodes = play(env, policy, plan.evaluation.first_seed, policy.mode)
    actions = load_policy(run, "deterministic")(env.reset())[ACTION]
    return {"actions": actions.tolist(), "saved": episodes["saved"].tolist()}


@pytest.mark.parametrize("release", RELEASES)
def test_a_golden_policy_acts_as_it_did(release):
    expected, now = json.loads((GOLDEN / release / "expected.json").read_text()), found_now(release)
    assert now["actions"] == expected["actions"]
    assert now["saved"] == pytest.approx(expected["saved"], abs=1e-6)


@pytest.mark.parametrize("release", RELEASES)
def test_a_golden_run_goes_on(release, tmp_path):
    run = shutil.copytree(GOLDEN / release, tmp_path / "run")
    found, skipped = newest(run)
    training = Training(
        run_config(plain(restore(found.saved_config(), ["total_frames=96"]))), found.saved_config(), run
    )
    training.load_state_dict(found.training())
    assert not skipped and training.frames == 64
    training.train()
    assert newest(run)[0].manifest.frames == 96
    assert all(value.isfinite().all() for value in newest(run)[0].policy().values())


@pytest.mark.parametrize("release", RELEASES)
def test_an_unknown_format_is_refused_by_name(release, tmp_path):
    run = shutil.copytree(GOLDEN / release, tmp_path / "run")
    forge(run / "checkpoints" / "64", format=3)
    with pytest.raises(CheckpointError, match="has format 3, this version reads 2"):
        load_policy(run)


@pytest.mark.parametrize("release", RELEASES)
def test_a_golden_run_is_small(release):
    assert sum(path.stat().st_size for path in (GOLDEN / release).rglob("*")) < 100_000


def test_golden_policies_play_in_make_env():
    policy = load_policy(GOLDEN / RELEASES[-1])
    assert "observation.identity=false" in policy.overrides
    env = make_env("skirmish", n_worlds=2, overrides=["landscape.size=8", *policy.overrides])
    rollout = env.rollout(3, policy, break_when_any_done=False)
    assert rollout[ACTION].shape == (2, 3, 2) and rollout[ACTION].dtype == torch.int64
