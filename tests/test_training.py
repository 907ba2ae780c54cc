"""The loop: a run resumed equals a run never stopped; rows, checkpoints, signals, finiteness."""

import csv
import os
import signal
from itertools import product

import pytest
import torch

from warp_torchrl import checkpoint as checkpoints
from warp_torchrl.api import policy_of
from warp_torchrl.checkpoint import CheckpointError, newest
from warp_torchrl.config import Record, compose_config, plain, without_targets
from warp_torchrl.models import ACTION
from warp_torchrl.settings import settings
from warp_torchrl.training import NumericalFailure, Stopped, Training

TINY = [
    "landscape.size=12",
    "horizon=20",
    "n_worlds=4",
    "collector.steps=8",
    "total_frames=192",
    "checkpoint.interval=64",
    "checkpoint.keep=10",
    "evaluation.episodes=4",
    "algorithm.minibatch_size=16",
    "model.actor_hidden=[16]",
    "model.critic_hidden=[16]",
]


REPLAY = ["algorithm.capacity=100", "algorithm.warm_up=64", "algorithm.updates=2"]


def tiny(run, *overrides):
    config = compose_config("train", [*TINY, *overrides])
    values = {k: v for k, v in without_targets(plain(config)).items() if k not in ("resume", "debug")}
    return Training(settings(plain(config)), Record(choices={}, values=values), run)


def rows(run):
    with (run / "metrics.csv").open(newline="") as file:
        return list(csv.DictReader(file))


def without_times(found):
    return [{name: value for name, value in row.items() if name not in ("time/seconds", "time/fps")} for row in found]


def flattened(state, prefix=""):
    """Every leaf of a nested state by its path."""
    if isinstance(state, dict):
        items = state.items()
    elif isinstance(state, (list, tuple)):
        items = enumerate(state)
    else:
        return {prefix: state}
    return {key: leaf for name, value in items for key, leaf in flattened(value, f"{prefix}/{name}").items()}


@pytest.fixture(scope="module")
def finished(tmp_path_factory):
    run = tmp_path_factory.mktemp("finished")
    training = tiny(run)
    training.train()
    return run, training


RUNS = {
    "mappo": ["algorithm=mappo"],
    "ippo": ["algorithm=ippo"],
    "a2c": ["algorithm=a2c"],
    "dqn": ["algorithm=dqn", "algorithm.target_interval=3", *REPLAY],
    "qmix": ["algorithm=qmix", *REPLAY],
    "sac": ["algorithm=sac", *REPLAY],
    "maddpg": ["algorithm=maddpg", *REPLAY],
    "all that moves": ["reward.normalise=true", "model.sharing=role", "team.roles=[ugv,uav]", "fire=hazard",
                       "wind=wandering", "reward=collaborative", "team.tank=3"],
}  # fmt: skip


@pytest.fixture(scope="module")
def never_stopped(tmp_path_factory):
    """Train each kind of run once, and return it with its folder."""
    done = {}

    def get(name):
        if name not in done:
            run = tmp_path_factory.mktemp("whole")
            training = tiny(run, *RUNS[name])
            training.train()
            done[name] = run, training
        return done[name]

    return get


@pytest.mark.parametrize(
    ("name", "stop_after"),
    [
        *product(("mappo", "all that moves"), (1, 3, 5)),
        *product(("ippo", "a2c", "qmix", "sac", "maddpg"), (3,)),
        ("dqn", 1),
        ("dqn", 5),
    ],
)
def test_a_run_resumed_equals_a_run_not_interrupted(tmp_path, never_stopped, stop_after, name):
    folder, whole = never_stopped(name)
    (tmp_path / "cut").mkdir()
    first = tiny(tmp_path / "cut", *RUNS[name])
    batches = iter(first.collection)
    for _ in range(stop_after):
        first.metrics.add({"time/frames": 0, "time/seconds": 0.0, "time/fps": 0.0, **first._learn(next(batches))})
    first.save()
    extra = first._learn(next(batches))  # lost with the crash that comes now
    first.metrics.add({"time/frames": 0, "time/seconds": 0.0, "time/fps": 0.0, **extra})
    torch.manual_seed(123)
    second = tiny(tmp_path / "cut", *RUNS[name])
    second.load_state_dict(newest(tmp_path / "cut")[0].training())
    second.train()
    ours, theirs = flattened(second.state_dict()), flattened(whole.state_dict())
    assert set(ours) == set(theirs)
    for name, value in theirs.items():
        if name == "/seconds":
            continue
        assert torch.equal(ours[name], value) if isinstance(value, torch.Tensor) else ours[name] == value, name
    resumed, expected = without_times(rows(tmp_path / "cut")), without_times(rows(folder))
    assert len(resumed) == len(expected) == 6
    assert resumed[stop_after:] == expected[stop_after:]


def test_metrics_have_the_columns_of_the_contract(finished):
    found = rows(finished[0])
    assert len(found) == 6
    for name in (
        "time/frames time/seconds time/fps rollout/ep_rew_mean rollout/ep_len_mean train/loss "
        "train/policy_gradient_loss train/value_loss train/entropy_loss train/approx_kl train/clip_fraction "
        "train/clip_range train/explained_variance world/saved"
    ).split():
        float(found[2][name])  # the horizon of 20 ends episodes in the third batch of eight steps
    assert [int(row["time/frames"]) for row in found] == [32, 64, 96, 128, 160, 192]
    assert found[0]["rollout/ep_len_mean"] == "", "no episode ends in the first eight steps"


def test_checkpoints_are_written_on_the_way_and_at_the_end(finished):
    run, training = finished
    names = sorted(int(each.name) for each in (run / "checkpoints").iterdir())
    assert names == [64, 128, 192]
    found, _ = newest(run)
    assert found.manifest.mode == training.mode


def test_a_loaded_policy_acts_as_the_trained_one(finished):
    run, training = finished
    env = training.settings.make_env(5, 77)
    now = env.reset()
    loaded = policy_of(newest(run)[0], "deterministic")
    with torch.no_grad():
        logits = training.learner.policy[0](now.clone())["agents", "logits"]
        assert torch.equal(loaded.module[0](now.clone())["agents", "logits"], logits)
    assert loaded(now)[ACTION].shape == (5, 2)


def test_training_moves_the_weights_and_seeds_repeat(tmp_path, finished):
    again = tiny(tmp_path)
    fresh = {name: value.clone() for name, value in again.learner.policy.state_dict().items()}
    again.train()
    for name, value in finished[1].learner.policy.state_dict().items():
        assert torch.equal(again.learner.policy.state_dict()[name], value)
    assert any((again.learner.policy.state_dict()[name] != value).any() for name, value in fresh.items())


def test_a_signal_saves_and_stops(tmp_path):
    training = tiny(tmp_path, "checkpoint.interval=1000000", "total_frames=1000000")
    learn = training._learn

    def interrupted(batch):
        if training.frames == 64:
            os.kill(os.getpid(), signal.SIGTERM)
        return learn(batch)

    training._learn = interrupted
    with pytest.raises(Stopped) as stopped:
        training.train()
    assert stopped.value.number == signal.SIGTERM
    assert newest(tmp_path)[0].manifest.frames == 96 and len(rows(tmp_path)) == 3


def test_a_gradient_that_is_not_finite_stops_before_the_weights_change(tmp_path):
    training = tiny(tmp_path)
    batch = next(iter(training.collection))
    before = {name: value.clone() for name, value in training.learner.loss.state_dict().items() if "params" in name}
    batch["next", "agents", "reward"].fill_(float("inf"))
    with pytest.raises(NumericalFailure, match="not finite"):
        training._learn(batch)
    for name, value in before.items():
        assert torch.equal(training.learner.loss.state_dict()[name], value)


def test_a_checkpoint_of_another_configuration_is_refused_in_one_line(finished, tmp_path):
    state = newest(finished[0])[0].training()
    for change in ("model.actor_hidden=[8]", "team.n_agents=3", "n_worlds=5", "landscape.size=10"):
        with pytest.raises(CheckpointError, match="does not fit") as error:
            tiny(tmp_path, change).load_state_dict(state)
        assert "\n" not in str(error.value)


def test_evaluation_on_the_way_leaves_the_run_as_it_was(tmp_path, finished):
    training = tiny(tmp_path, "evaluation.interval=64")
    training.train()
    evaluated = [row["evaluation/saved"] for row in rows(tmp_path)]
    assert [value != "" for value in evaluated] == [False, True, False, True, False, True]
    ours = without_times([{**row, "evaluation/saved": ""} for row in rows(tmp_path)])
    assert ours == without_times(rows(finished[0]))


def test_keep_bounds_the_checkpoints(tmp_path):
    tiny(tmp_path, "checkpoint.interval=32", "checkpoint.keep=2").train()
    assert sorted(int(each.name) for each in (tmp_path / "checkpoints").iterdir()) == [160, 192]
    assert checkpoints.newest(tmp_path)[0].manifest.frames == 192
