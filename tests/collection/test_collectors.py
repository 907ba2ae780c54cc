"""Worlds that are played elsewhere are the worlds that would be played here."""

import os
import signal
import sys
from pathlib import Path

import pytest
import torch

from warp_torchrl.algorithms.parallel import WorkerDied
from warp_torchrl.collection.collectors import InProcess, MultiProcess, Ray
from warp_torchrl.runs.checkpoint import newest
from warp_torchrl.runs.config.building import run_config
from warp_torchrl.runs.config.compose import compose_config
from warp_torchrl.runs.config.construction import ConfigError
from warp_torchrl.runs.config.plain_values import plain
from warp_torchrl.runs.config.saved_config import SavedConfig
from warp_torchrl.runs.config.seeds import first_world_seed
from warp_torchrl.training.loop import Training

TINY = [
    "scenario=single",
    "algorithm=ppo",
    "landscape.size=8",
    "n_worlds=4",
    "horizon=12",
    "collector.steps=6",
    "collector.grows_at=0",
    "model.actor_hidden=[8]",
    "model.critic_hidden=[8]",
    "algorithm.minibatch_size=24",
    "evaluation.episodes=2",
    "total_frames=96",
]


def training(folder: Path, *overrides: str) -> Training:
    return Training(run_config(plain(compose_config("train", [*TINY, *overrides]))), SavedConfig(), folder)


def first_batches(folder: Path, *overrides: str) -> list:
    run = training(folder, *overrides)
    try:
        batches = iter(run.collection)
        first = next(batches).clone()
        run._learn([first.clone()])
        return [first, next(batches).clone()]
    finally:
        run.close()


@pytest.fixture(scope="module")
def here(tmp_path_factory):
    return first_batches(tmp_path_factory.mktemp("here"), "collector=direct", "seed=1234")


def check_like(here, elsewhere):
    first, other = here[0], elsewhere[0]
    assert first.batch_size == other.batch_size == torch.Size([4, 6])
    assert set(other.keys(True, True)) == set(first.keys(True, True))
    for name in ("state", ("agents", "observation", "view"), ("agents", "action_mask")):
        assert torch.equal(first[name][:, 0], other[name][:, 0]), "the same fires in the same order"
    # Each worker draws actions of its own: two worlds would agree on all twelve draws with chance 11^-12 or so.
    actions = torch.cat([each["agents", "action"] for each in elsewhere], dim=1).flatten(1)
    assert not (actions[:2] == actions[2:]).all()
    assert (elsewhere[1]["agents", "action_log_prob"] < 0.0).all()


@pytest.mark.slow
def test_processes_play_the_same_worlds(tmp_path, here):
    check_like(here, first_batches(tmp_path, "collector=process", "seed=1234"))


@pytest.mark.slow
def test_ray_plays_the_same_worlds(tmp_path, here):
    pytest.importorskip("ray", reason="Ray is not installed")
    check_like(here, first_batches(tmp_path, "collector=ray", "seed=1234"))


@pytest.mark.stress
def test_a_worker_that_dies_is_named_and_what_was_learnt_is_saved(tmp_path):
    run = training(tmp_path, "collector=process", "collector.workers=1", "total_frames=100_000")
    learn = run._learn

    def killing(batch):
        row = learn(batch)
        if run.frames == 48:
            os.kill(run.collection._collector.procs[0].pid, signal.SIGKILL)
        return row

    run._learn = killing
    with pytest.raises(WorkerDied, match="a worker has ended: worker 0 by signal 9"):
        run.train()
    run.close()
    assert newest(tmp_path)[0].manifest.frames == 48
    assert newest(tmp_path)[0].training()["collection"] == {"played": 12}


@pytest.mark.slow
def test_a_resumed_run_meets_new_fires(tmp_path, here):
    run = training(tmp_path, "collector=process", "collector.workers=1", "seed=1234")
    run.collection.load_state_dict({"played": 12})
    try:
        batch = next(iter(run.collection))
    finally:
        run.close()
    assert not torch.equal(batch["state"][:, 0], here[0]["state"][:, 0])
    env = run.run_config.make_env(4, first_world_seed(1234))
    env.set_seeds(range(first_world_seed(1234), first_world_seed(1234) + 4), first_episode=12)
    assert torch.equal(env.reset()["state"], batch["state"][:, 0])


@pytest.mark.parametrize(("progress", "segments"), [(0.0, 1), (0.249, 1), (0.25, 4), (1.0, 4)])
def test_batches_have_all_their_steps_from_a_share_of_the_training_on(progress, segments):
    assert InProcess(steps=32, first_steps=8, grows_at=0.25).segments(progress) == segments
    assert InProcess(steps=32, grows_at=0.0).segments(progress) == 1


def test_a_segment_is_the_first_batch_or_half_of_one_or_all_of_an_odd_one():
    told = {(32, None): 16, (5, None): 5, (32, 8): 8, (8, 8): 8}
    for (steps, first), segment in told.items():
        assert InProcess(steps=steps, first_steps=first, grows_at=0.25).segment == segment
    assert InProcess(steps=32, first_steps=8, grows_at=0.0).segment == 32


def test_a_training_ends_in_whole_batches():
    # 4 worlds: batches of 32 frames until 25 of 100 are played, one, then of 128: 160 in all
    growing = InProcess(steps=32, first_steps=8, grows_at=0.25)
    assert growing.end(100, 4) == 32 + 128 and growing.end(160, 4) == 2 * 32 + 128
    assert growing.end(32, 4) == 32 and growing.end(33, 4) == 32 + 128
    assert InProcess(steps=32, grows_at=0.0).end(129, 4) == 256
    assert InProcess(steps=8, first_steps=4, grows_at=1.0).end(33, 4) == 48


def test_workers_must_share_the_worlds():
    with pytest.raises(ConfigError, match=r"collector\.workers must divide n_worlds, 4, got 3"):
        run_config(plain(compose_config("train", [*TINY, "collector=process", "collector.workers=3"])))
    with pytest.raises(ValueError, match="workers must be in"):
        MultiProcess(workers=0)
    for name in ("cpus", "gpus"):
        with pytest.raises(ValueError, match=f"{name} must be in"):
            Ray(**{name: -0.5})


def test_a_missing_ray_is_told(monkeypatch):
    monkeypatch.setitem(sys.modules, "ray", None)
    with pytest.raises(ConfigError, match=r"collector\.workers need Ray: pip install"):
        run_config(plain(compose_config("train", [*TINY, "collector=ray"])))
