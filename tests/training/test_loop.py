"""The loop: a run resumed equals a run never stopped; rows, checkpoints, signals, finiteness."""

import csv
import os
import re
import shutil
import signal
from copy import deepcopy
from dataclasses import replace
from itertools import product
from pathlib import Path
from types import SimpleNamespace

import numpy as np
import pytest
import torch

from tests.world.mechanics import of_mechanics
from tests.world.mechanics.there import can_play
from warp_torchrl.algorithms import parallel
from warp_torchrl.models import ACTION
from warp_torchrl.runs import checkpoint as checkpoints
from warp_torchrl.runs.checkpoint import CheckpointError, newest
from warp_torchrl.runs.config.building import run_config
from warp_torchrl.runs.config.compose import compose_config, conf_folder
from warp_torchrl.runs.config.plain_values import plain, without_targets
from warp_torchrl.runs.config.saved_config import SavedConfig
from warp_torchrl.runs.export import export
from warp_torchrl.runs.policies.load import policy_of
from warp_torchrl.system import disk
from warp_torchrl.system.signals import DeferredSignals, Stopped
from warp_torchrl.training import loop
from warp_torchrl.training.finite import NumericalFailure
from warp_torchrl.training.loop import Training
from warp_torchrl.world.mechanics.mechanic import Metric

TINY = [
    "landscape.size=12",
    "horizon=20",
    "n_worlds=4",
    "collector.steps=8",
    "collector.grows_at=0",
    "total_frames=192",
    "checkpoint.interval=64",
    "checkpoint.minutes=0",
    "checkpoint.keep=10",
    "evaluation.episodes=4",
    "evaluation.mode=sampled",
    "algorithm.minibatch_size=16",
    "model.actor_hidden=[16]",
    "model.critic_hidden=[16]",
]


REPLAYS = ("dqn", "vdn", "qmix", "sac", "ddpg", "maddpg")
REPLAY = ["algorithm.capacity=60", "algorithm.warm_up=32", "algorithm.updates=2"]


TINIER = ["horizon=10", "collector.steps=4", "total_frames=64", "checkpoint.interval=32"]


def tiny(run, *overrides):
    config = compose_config("train", [*TINY, *overrides])
    values = {k: v for k, v in without_targets(plain(config)).items() if k not in ("resume", "debug")}
    return Training(run_config(plain(config)), SavedConfig(choices={}, values=values), run)


def frames(run):
    return [int(row["time/frames"]) for row in rows(run)]


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
    training = tiny(run, "evaluation.mode=best")
    training.train()
    return run, training


ALGORITHMS = sorted(path.stem for path in (conf_folder() / "algorithm").glob("*.yaml"))
LAST = 4  # iterations of a tiny run
RUNS = {
    "all that moves": ["reward.normalise=true", "model.sharing=role", "team.roles=[ugv,uav]", "fire=hazard",
                       "wind=wandering", "reward=collaborative", "team.tank=3"],
    "taught": ["imitation.teacher=greedy", "imitation.until=0.7"],
    "remembers": ["model.memory=8"],
    "grows": ["collector.first_steps=2", "collector.grows_at=0.3", "total_frames=48"],
    "climbs": ["curriculum=success", "curriculum.over.steps_per_tick=[9,6,1]", "curriculum.over.horizon=[6,8,10]",
               "curriculum.episodes=4", "curriculum.low=0.01", "curriculum.high=0.02", "curriculum.floor=0.25"],
    "regrets": ["curriculum=regret", "curriculum.over.steps_per_tick=[9,6,1]", "curriculum.over.wind.speed=[0,2,4]",
                "curriculum.episodes=2", "curriculum.worlds=4", "algorithm=dqn", *REPLAY],
    "talks": ["scenario=search", "landscape.size=12", "horizon=10", "model.messages=both", "model.message_size=8",
              "mechanics.radio.range=4", "mechanics.radio.loss=0.2", "sensing.miss=0.1", "sensing.smoke=1.0"],
    "talks late": ["scenario=search", "landscape.size=12", "horizon=10", "model.messages=both", "model.message_size=8",
                   "mechanics.radio.delay=2", "mechanics.radio.loss=0.2"],
    "mixes": ["reward.normalise=true", "model.memory=8", "imitation.teacher=local", "imitation.until=0.7",
              "imitation.weight_end=0.1", "algorithm.critic_first=0.7",
              "algorithm.minibatch_size=32", "mixture=several", "mixture.weigh=left", "mixture.worlds=2",
              "mixture.kinds={one:{scenario:single,over:{horizon:8}},"
              "two:{scenario:skirmish,share:2,teacher:greedy,over:{horizon:10}}}"],
    "compiled": ["compile=true", "imitation.teacher=greedy", "imitation.until=0.7"],
    **of_mechanics("RUNS"),
    **{name: [f"algorithm={name}", *(REPLAY if name in REPLAYS else [])] for name in ALGORITHMS},
}  # fmt: skip
RUNS = {name: overrides for name, overrides in RUNS.items() if can_play(overrides)}
RUNS["dqn"] += ["algorithm.target_interval=3"]


@pytest.fixture(scope="module")
def never_stopped(tmp_path_factory):
    """Train each kind of run once, and return it with its folder."""
    # What acts better is not asked of these runs: it plays more than they do.
    done = {}

    def get(name):
        if name not in done:
            run = tmp_path_factory.mktemp("whole")
            training = tiny(run, *TINIER, *RUNS[name])
            training.train()
            done[name] = run, training
        return done[name]

    return get


FAST = {
    ("all that moves", 1),
    ("regrets", 2),
    ("talks late", 2),
    ("mixes", 2),
    ("grows", 2),
    ("mappo", LAST),
    ("dqn", 1),
    ("sac", 2),
}


@pytest.mark.parametrize(
    ("name", "stop_after"),
    [
        pytest.param(*each, marks=() if each in FAST else pytest.mark.stress)
        for each in product(RUNS, range(1, LAST + 1))
    ],
)
def test_a_run_resumed_equals_a_run_not_interrupted(tmp_path, never_stopped, stop_after, name):
    folder, whole = never_stopped(name)
    (tmp_path / "cut").mkdir()
    first = tiny(tmp_path / "cut", *TINIER, *RUNS[name])
    batches = first.batches()
    for _ in range(stop_after):
        first.metrics.add({"time/frames": 0, "time/seconds": 0.0, "time/fps": 0.0, **first._learn(next(batches))})
    first.save()
    extra = first._learn(next(batches))  # lost with the crash that comes now
    first.metrics.add({"time/frames": 0, "time/seconds": 0.0, "time/fps": 0.0, **extra})
    torch.manual_seed(123)
    second = tiny(tmp_path / "cut", *TINIER, *RUNS[name])
    second.load_state_dict(newest(tmp_path / "cut")[0].training())
    second.train()
    ours, theirs = flattened(second.state_dict()), flattened(whole.state_dict())
    assert set(ours) == set(theirs)
    for name, value in theirs.items():
        if name == "/seconds":
            continue
        assert torch.equal(ours[name], value) if isinstance(value, torch.Tensor) else ours[name] == value, name
    resumed, expected = without_times(rows(tmp_path / "cut")), without_times(rows(folder))
    assert len(resumed) == len(expected) == LAST
    assert resumed[stop_after:] == expected[stop_after:]


@pytest.mark.slow
@pytest.mark.parametrize("name", [each for each in RUNS if each not in ("climbs", "regrets", "mixes")])
def test_a_compiled_loss_is_the_eager_one(tmp_path, name):
    training = tiny(tmp_path, *RUNS[name], "compile=true", "model.dtype=float32", "algorithm.learning_rate=0")
    learner, eager = training.learner, tiny(tmp_path, *RUNS[name], "model.dtype=float32").learner
    assert learner.terms is not learner.loss
    for batch in training.collection:
        learner.store(batch)
        sample = next(iter(learner.samples()), None)
        if sample is not None:
            break
    eager.loss.load_state_dict(learner.loss.state_dict())
    gradients = []
    for one in (learner, eager):
        terms = one.terms(sample.clone())
        sum(terms[key] for key in learner.loss_keys).backward()
        gradients.append({key: value.grad for key, value in one.loss.named_parameters() if value.grad is not None})
        gradients[-1] |= {key: terms[key].detach() for key in learner.loss_keys}
    assert gradients[0].keys() == gradients[1].keys()
    for key, value in gradients[1].items():
        torch.testing.assert_close(gradients[0][key], value, rtol=1e-3, atol=1e-5)


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


NO_BONUS = ["algorithm.entropy_coeff=0", "algorithm.entropy_coeff_end=0"]


@pytest.mark.parametrize(
    ("overrides", "explains"),
    [
        (["algorithm=a2c", *NO_BONUS], True),
        (NO_BONUS, True),
        (["algorithm=sac", *REPLAY], False),
        (["algorithm=ddpg", *REPLAY], False),
    ],
    ids=["a2c", "mappo", "sac", "ddpg"],
)
def test_the_entropy_loss_is_minus_the_entropy_whatever_it_weighs(tmp_path, overrides, explains):
    training = tiny(tmp_path, *TINIER, "total_frames=32", *overrides)
    training.train()
    last = rows(tmp_path)[-1]
    # Eleven actions at most: a young policy chooses among those that are open nearly uniformly.
    entropy = float(last["train/entropy"])
    assert 0.5 < entropy < 2.4 and float(last["train/entropy_loss"]) == -entropy
    assert (last["train/explained_variance"] != "") == explains


def test_checkpoints_are_written_on_the_way_and_at_the_end(finished):
    run, training = finished
    names = sorted(int(each.name) for each in (run / "checkpoints").iterdir())
    assert names == [64, 128, 192]
    found, _ = newest(run)
    assert found.manifest.mode == training.mode


def test_a_loaded_policy_acts_as_the_trained_one(tmp_path):
    training = tiny(tmp_path, "model.dtype=float32", "total_frames=64")
    training.train()
    env = training.run_config.make_env(5, 77)
    now = env.reset()
    loaded = policy_of(newest(tmp_path)[0], "deterministic")
    with torch.no_grad():
        logits = training.learner.policy[0](now.clone())["agents", "logits"]
        acts = loaded.module[0](now.clone())["agents", "logits"]
    # In training the first layer leaves out what this world cannot fill: the same sums, in another order.
    torch.testing.assert_close(acts, logits, rtol=0, atol=1e-6)
    assert loaded(now)[ACTION].shape == (5, 2)


@pytest.mark.parametrize(("frames", "level"), [(5, "WARNING"), (20, "INFO"), (16, None)])
def test_whole_batches_are_not_trained_on_without_a_word(tmp_path, caplog, frames, level):
    training = tiny(tmp_path, *TINIER, f"total_frames={frames}")
    with caplog.at_level("INFO", "warp_torchrl"):
        training.train()
    told = [record.levelname for record in caplog.records if "total_frames=" in record.message]
    assert told == ([] if level is None else [level])


def test_a_signal_saves_and_stops(tmp_path):
    training = tiny(tmp_path, "checkpoint.interval=1000000", "total_frames=1000000")
    learn = training._learn

    def interrupted(batch):
        if training.frames == 64:
            os.kill(os.getpid(), signal.SIGTERM)
        return learn(batch)

    training._learn = interrupted
    with pytest.raises(Stopped) as stopped, DeferredSignals() as signals:
        training.train(signals)
    assert stopped.value.number == signal.SIGTERM
    assert newest(tmp_path)[0].manifest.frames == 96 and len(rows(tmp_path)) == 3


def test_a_gradient_that_is_not_finite_stops_before_the_weights_change(tmp_path):
    training = tiny(tmp_path)
    batch = next(iter(training.collection))
    before = {name: value.clone() for name, value in training.learner.loss.state_dict().items() if "params" in name}
    batch["next", "agents", "reward"].fill_(float("inf"))
    with pytest.raises(NumericalFailure, match="not finite"):
        training._learn([batch])
    for name, value in before.items():
        assert torch.equal(training.learner.loss.state_dict()[name], value)


def test_a_loss_that_is_not_finite_stops_though_its_gradient_is(tmp_path):
    training = tiny(tmp_path)
    batch = next(iter(training.collection))
    before = flattened(training.learner.policy.state_dict())
    loss = training.learner.loss.forward

    def infinite(sample):
        terms = loss(sample)
        return terms.set("loss_critic", terms["loss_critic"] + float("inf"))

    training.learner.loss.forward = infinite
    with pytest.raises(NumericalFailure, match=r"the loss, inf, or its gradient, of norm [0-9.]+, is not finite"):
        training._learn([batch])
    assert all(
        torch.equal(value, before[name]) for name, value in flattened(training.learner.policy.state_dict()).items()
    )


@pytest.mark.parametrize("bad", [float("nan"), float("inf")])
def test_a_reward_that_is_not_finite_is_never_remembered(tmp_path, bad):
    training = tiny(tmp_path, *RUNS["dqn"])
    batch = next(iter(training.collection))
    batch["next", "agents", "reward"][2, 3] = bad
    with pytest.raises(NumericalFailure, match="a reward is not finite"):
        training._learn([batch])
    assert not training.state_dict()["keeps"]["replay"]["_storage"]


def test_a_numerical_failure_leaves_the_last_checkpoint(tmp_path):
    training = tiny(tmp_path)
    learn = training._learn

    def poisoned(batch):
        if training.frames == 96:
            batch[0]["next", "agents", "reward"].fill_(float("nan"))
        return learn(batch)

    training._learn = poisoned
    with pytest.raises(NumericalFailure):
        training.train()
    found, skipped = newest(tmp_path)
    assert found.manifest.frames == 64 and not skipped and len(rows(tmp_path)) == 3
    assert all(value.isfinite().all() for value in found.policy().values())


def test_a_checkpoint_of_another_configuration_is_refused_in_one_line(finished, tmp_path):
    state = newest(finished[0])[0].training()
    for change in ("model.actor_hidden=[8]", "team.n_agents=3", "n_worlds=5", "landscape.size=10"):
        with pytest.raises(CheckpointError, match="does not fit") as error:
            tiny(tmp_path, change).load_state_dict(state)
        assert "\n" not in str(error.value)


@pytest.mark.parametrize("change", ["renamed", "missing", "more"])
def test_networks_of_other_names_are_refused(finished, tmp_path, change):
    """tensordict would take them as they come and go on with weights that nothing reads."""
    state = newest(finished[0])[0].training()
    name = next(each for each in state["loss"] if each.endswith("weight"))
    if change != "missing":
        state["loss"][name + "s"] = state["loss"][name]
    if change != "more":
        del state["loss"][name]
    with pytest.raises(CheckpointError, match=f"does not fit this configuration: .*{name}s? is in one"):
        tiny(tmp_path).load_state_dict(state)


@pytest.mark.parametrize("entry", ["loss", "optimizer", "keeps", "collection", "random", "frames", "rows"])
@pytest.mark.parametrize("harm", ["missing", "of another type"])
def test_a_load_that_fails_leaves_the_run_as_it_was(make_dqn, finished, entry, harm):
    run, training, state = make_dqn
    before, table = flattened(deepcopy(training.state_dict())), (run / "metrics.csv").read_bytes()
    broken = {name: value for name, value in state.items() if name != entry}
    if harm == "of another type":
        broken[entry] = ["not", "what", "was", "saved"]
    with pytest.raises(CheckpointError, match="does not fit") as error:
        training.load_state_dict(broken)
    assert "\n" not in str(error.value)
    for name, value in flattened(training.state_dict()).items():
        assert torch.equal(value, before[name]) if isinstance(value, torch.Tensor) else value == before[name], name
    assert (run / "metrics.csv").read_bytes() == table


@pytest.fixture(scope="module")
def make_dqn(tmp_path_factory):
    """A run that has learnt a little, and the state that another one saved later in the same folder."""
    run = tmp_path_factory.mktemp("dqn")
    later = tiny(run, *TINIER, *RUNS["dqn"])
    later.train()
    training = tiny(tmp_path_factory.mktemp("young"), *TINIER, *RUNS["dqn"])
    batches = training.batches()
    for _ in range(3):
        training._learn(next(batches))
    training.run = run
    return run, training, later.state_dict()


def test_metrics_that_lost_rows_are_refused(finished, tmp_path):
    shutil.copytree(finished[0], tmp_path / "run")
    state = newest(tmp_path / "run")[0].training()
    for lines in (["time/frames", "32"], []):
        (tmp_path / "run" / "metrics.csv").write_text("\n".join(lines))
        with pytest.raises(CheckpointError, match=r"metrics\.csv must hold the 6 rows of the checkpoint, got [01]"):
            tiny(tmp_path / "run").load_state_dict(state)


def test_a_torn_last_row_is_cut(finished, tmp_path):
    shutil.copytree(finished[0], tmp_path / "run")
    whole = (tmp_path / "run" / "metrics.csv").read_bytes()
    (tmp_path / "run" / "metrics.csv").write_bytes(whole + b'224,"0.1\x00\xff')
    tiny(tmp_path / "run").load_state_dict(newest(finished[0])[0].training())
    assert (tmp_path / "run" / "metrics.csv").read_bytes() == whole


@pytest.mark.skipif(not Path("/dev/full").exists(), reason="this system has no /dev/full")
def test_a_full_disk_stops_the_run_with_the_last_checkpoint_sound(tmp_path):
    training = tiny(tmp_path)
    learn = training._learn

    def fills(batch):
        if training.frames == 96:
            (tmp_path / "metrics.csv").rename(tmp_path / "rows")
            (tmp_path / "metrics.csv").symlink_to("/dev/full")
        return learn(batch)

    training._learn = fills
    with pytest.raises(OSError, match="No space left on device") as error:
        training.train()
    assert error.value.filename == str(tmp_path / "metrics.csv")
    assert newest(tmp_path)[0].manifest.frames == 64


def test_training_moves_the_weights_seeds_repeat_and_evaluation_on_the_way_leaves_the_run_as_it_was(tmp_path, finished):
    training = tiny(tmp_path, "evaluation.interval=64")
    fresh = {name: value.clone() for name, value in training.learner.policy.state_dict().items()}
    training.train()
    weights = training.learner.policy.state_dict()
    for name, value in finished[1].learner.policy.state_dict().items():
        assert torch.equal(weights[name], value)
    assert any((weights[name] != value).any() for name, value in fresh.items())
    evaluated = [row["evaluation/saved"] for row in rows(tmp_path)]
    assert [value != "" for value in evaluated] == [False, True, False, True, False, True]
    ours = without_times([{**row, "evaluation/saved": ""} for row in rows(tmp_path)])
    assert ours == without_times(rows(finished[0]))


def test_keep_bounds_the_checkpoints(tmp_path):
    tiny(tmp_path, *TINIER, "checkpoint.interval=16", "checkpoint.keep=2").train()
    assert sorted(int(each.name) for each in (tmp_path / "checkpoints").iterdir()) == [48, 64]
    assert checkpoints.newest(tmp_path)[0].manifest.frames == 64


def test_a_longer_training_has_its_schedules_where_its_own_total_puts_them(finished, tmp_path, caplog):
    shutil.copytree(finished[0], tmp_path / "run")
    longer = tiny(
        tmp_path / "run", "total_frames=384", "algorithm.learning_rate=1e-3", "algorithm.learning_rate_end=0.1"
    )
    longer.load_state_dict(newest(tmp_path / "run")[0].training())
    with caplog.at_level("INFO", logger="warp_torchrl"):
        longer.log_new_total(192)
    assert longer.learner.optimizer.param_groups[0]["lr"] == pytest.approx(0.55e-3)
    said = "total_frames was 192 and is 384: what changes over a training goes on as at 50.0 % of the new total"
    assert caplog.messages == [f"{said}, train/learning_rate 0.0001 -> 0.00055"]


def test_a_run_starts_from_another_ones_networks_and_its_own_settings(finished, tmp_path):
    found, _ = newest(finished[0])
    training = tiny(tmp_path, "algorithm.gamma=0.9", "algorithm.clip_epsilon=0.1", "landscape.size=16", "n_worlds=3")
    before = training.learner.loss.state_dict()
    training.start_from(found)
    now, theirs = training.learner.loss.state_dict(), found.training()["loss"]
    learnt = {name for name in now if "_params." in name or "value_norm" in name}
    assert len(learnt) > 10 and all(torch.equal(now[name], theirs[name]) for name in learnt)
    for name in set(now) - learnt:
        assert torch.equal(now[name], before[name]), name
    assert float(now["clip_epsilon"]) == pytest.approx(0.1) and training.frames == 0
    seen = training.env.reset()
    logits = [each.learner.policy[0](seen.clone())["agents", "logits"] for each in (training, finished[1])]
    assert torch.equal(*logits), "the policy is the other run's"


def test_a_run_starts_from_an_exported_policy_with_a_critic_of_its_own(finished, tmp_path):
    export(newest(finished[0])[0], tmp_path / "alone")
    training = tiny(tmp_path, *TINIER, "landscape.size=16", "n_worlds=3", "total_frames=24")
    before = {name: each.clone() for name, each in training.learner.loss.state_dict().items()}
    training.start_from(newest(tmp_path / "alone")[0])
    seen = training.env.reset()
    logits = [each.learner.policy[0](seen.clone())["agents", "logits"] for each in (training, finished[1])]
    assert torch.equal(*logits), "the policy is the exported one"
    now = training.learner.loss.state_dict()
    changed = {name.split(".")[0] for name in now if not torch.equal(now[name], before[name])}
    assert changed == {"actor_network_params"}
    training.train()
    assert training.frames >= training.run_config.total_frames, "and it learns"


def test_a_run_starts_from_a_policy_that_sees_less_and_does_as_it_did(finished, tmp_path, caplog):
    found, _ = newest(finished[0])
    training = tiny(tmp_path, "observation.rules=true", "landscape.size=16", "n_worlds=3")
    critic = {name: each.clone() for name, each in training.learner.loss.state_dict().items() if "critic" in name}
    with caplog.at_level("INFO", logger="warp_torchrl"):
        training.start_from(found)
    fresh, new = caplog.messages
    assert fresh == "start_from: the critic starts fresh, for status is not as it was there"
    assert "learns to see rule_burning, rule_horizon" in new and new.endswith("which weigh nothing at first")
    now = training.learner.loss.state_dict()
    assert all(torch.equal(now[name], each) for name, each in critic.items())
    seen = training.env.reset()
    less = seen.clone()
    known = [training.env.channel_names["status"].index(name) for name in finished[1].env.channel_names["status"]]
    less["agents", "observation", "status"] = seen["agents", "observation", "status"][..., known]
    logits = [
        each.learner.policy[0](given)["agents", "logits"] for each, given in ((training, seen), (finished[1], less))
    ]
    assert torch.allclose(*logits, atol=1e-6)


def test_an_adviser_and_trust_in_it_may_be_new(finished, tmp_path):
    given = ["observation.rules=true", "observation.advice=dispatch", "model.trust=0.5"]
    training = tiny(tmp_path, *given)
    training.start_from(newest(finished[0])[0])
    names = training.env.channel_names["status"]
    (weight,) = [each for name, each in training.learner.policy.state_dict().items() if name.endswith("parts.0.weight")]
    new = [place for place, name in enumerate(names) if name.startswith(("advice_", "rule_"))]
    assert weight.shape[1] == len(names) and not weight[:, new].any() and weight.any()


def test_a_critic_stays_where_messages_come_late_from_now_on(tmp_path, caplog):
    (tmp_path / "a").mkdir()
    tiny(tmp_path / "a", "model.messages=graph", *TINIER).train()
    found, training = newest(tmp_path / "a")[0], tiny(tmp_path / "b", "model.messages=graph", "mechanics.radio.delay=2")
    caplog.clear()
    with caplog.at_level("INFO", logger="warp_torchrl"):
        training.start_from(found)
    now, theirs = training.learner.loss.state_dict(), found.training()["loss"]
    assert not caplog.messages
    critic = [name for name in now if "critic_network_params" in name]
    assert critic and all(torch.equal(now[name], theirs[name]) for name in critic)


def test_actions_and_roles_of_networks_are_those_of_the_start(finished, tmp_path):
    with pytest.raises(CheckpointError, match=r"actions is north, .* there, .* here$"):
        tiny(tmp_path / "a", "team.allow_stay=false").start_from(newest(finished[0])[0])
    roles = ["model.sharing=role", *TINIER]
    (tmp_path / "b").mkdir()
    tiny(tmp_path / "b", *roles, "team.roles=[ugv]").train()
    with pytest.raises(CheckpointError, match=r"roles is ugv, uav there, .* here$"):
        tiny(tmp_path / "c", *roles, "sensing=sight", "team.roles=[scout,ugv]").start_from(newest(tmp_path / "b")[0])


def test_replays_start_from_what_was_seen_alone(tmp_path):
    first = tiny(tmp_path, "algorithm=dqn", *REPLAY, *TINIER)
    first.train()
    found = newest(tmp_path)[0]
    status = found.manifest.signature.observation["status"]
    turned = found.manifest.signature.observation | {"status": status._replace(names=status.names[::-1])}
    other = replace(found.manifest, signature=found.manifest.signature._replace(observation=turned))
    with pytest.raises(CheckpointError, match="the names of status is"):
        first.start_from(replace(found, manifest=other))
    first.start_from(found)


@pytest.mark.parametrize("change", ["model.actor_hidden=[8]", "algorithm=ippo", "algorithm=dqn"])
def test_networks_of_another_kind_are_no_start(finished, tmp_path, change):
    training = tiny(tmp_path, change)
    before = flattened(training.state_dict())
    with pytest.raises(CheckpointError, match="was trained by another algorithm or other networks") as refusal:
        training.start_from(newest(finished[0])[0])
    assert re.search(r": \S+ is (\[[\d, ]+\]|missing) there, (\[[\d, ]+\]|missing) here$", str(refusal.value))
    assert all(torch.equal(value, before[name]) for name, value in flattened(training.state_dict()).items()
               if isinstance(value, torch.Tensor))  # fmt: skip


def test_batches_and_their_minibatches_grow(tmp_path):
    training = tiny(tmp_path, "collector.first_steps=4", "collector.grows_at=0.5", "algorithm.epochs=1")
    sizes = []
    update = training._update
    training._update = lambda sample: sizes.append(len(sample)) or update(sample)
    training.train()
    assert frames(tmp_path) == [16, 32, 48, 64, 80, 96, 128, 160, 192]
    assert sizes == [8] * 12 + [16] * 6  # two updates a batch


@pytest.mark.parametrize("overrides", [["algorithm=dqn", *REPLAY], ["model.memory=8"]])
def test_replayed_and_remembered_batches_have_one_size(tmp_path, overrides):
    training = tiny(tmp_path, "collector.first_steps=4", "collector.grows_at=0.5", "total_frames=64", *overrides)
    training.train()
    assert frames(tmp_path) == [32, 64]


def test_a_batch_of_segments_is_one_of_all_steps(tmp_path):
    def first(name, *overrides):
        (tmp_path / name).mkdir()
        training = tiny(tmp_path / name, *overrides)
        training._segments = training.collector.segments(1.0)
        return next(training.batches())[0]

    one = first("whole")
    other = first("parts", "collector.first_steps=4", "collector.grows_at=0.5")
    assert one.shape == other.shape == (4, 8)
    for key, value in one.items(include_nested=True, leaves_only=True):
        assert torch.equal(value, other[key]), key


def test_a_policy_acts_in_the_mode_that_reaches_more_of_what_its_team_is_for(monkeypatch):
    reached = {"sampled": {"saved": 0.5, "watched": 0.1}, "deterministic": {"saved": 0.2, "watched": 0.9}}

    def played(env, policy, first_seed, mode):
        return {name: np.full(2, value) for name, value in reached[mode].items()}

    monkeypatch.setattr(loop, "play", played)
    plan = run_config(plain(compose_config("train", ["evaluation.episodes=2"])))
    for goal, mode in (("saved", "sampled"), ("watched", "deterministic")):
        monkeypatch.setattr(loop, "goal", lambda world, goal=goal: Metric(goal, "more"))
        assert Training._better_mode(SimpleNamespace(run_config=plan, learner=SimpleNamespace(policy=None))) == mode


def test_the_size_of_a_checkpoint_counts_what_every_process_has_of_its_own(finished, monkeypatch):
    training = finished[1]
    whole, own = disk.tensors_size(training.state_dict()), disk.tensors_size(training._own())
    assert training._size() == whole > own > 0
    monkeypatch.setattr(parallel, "size", lambda: 3)
    assert training._size() == whole + 2 * own


@pytest.mark.parametrize("had_ended", [False, True])
def test_another_process_goes_on_with_its_own_worlds_or_with_new_ones(finished, tmp_path, monkeypatch, had_ended):
    training, theirs = tiny(tmp_path, "seed=5"), finished[1]
    saved = {**theirs.state_dict(), "others": None if had_ended else [{}, deepcopy(theirs._own())]}
    for name, value in (("rank", 2), ("size", 3), ("share", saved)):
        monkeypatch.setattr(parallel, name, lambda *given, value=value: value)
    training.join()
    assert training.frames == 192
    learnt = flattened(training.learner.loss.state_dict())
    assert all(torch.equal(learnt[name], each) for name, each in flattened(theirs.learner.loss.state_dict()).items())
    if had_ended:  # a world has had one episode a step at most
        assert training.env.state_dict()["episodes"].tolist() == [192 // 4 + 1] * 4, "of the next ones"
        return
    ours = flattened(training._own())
    for name, value in flattened(theirs._own()).items():
        assert torch.equal(ours[name], value) if isinstance(value, torch.Tensor) else ours[name] == value, name
