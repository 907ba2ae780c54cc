"""Several kinds of worlds in one training: their seeds, weights, gradients and columns."""

import re

import pytest
import torch

from tests.training.test_loop import TINY, rows, tiny
from tests.world.mechanics.there import needs
from warp_torchrl.models import REWARD, differing, joint, signature
from warp_torchrl.runs.config.building import run_config
from warp_torchrl.runs.config.compose import compose_config
from warp_torchrl.runs.config.plain_values import plain
from warp_torchrl.runs.config.seeds import first_world_seed

THREE = [
    "mixture=several",
    "mixture.kinds={one:{scenario:single,over:{horizon:8}},two:{scenario:skirmish,share:2,over:{horizon:8}},"
    "large:{scenario:default,over:{horizon:8,landscape:{size:24}}}}",
    "n_worlds=8",
    "algorithm.minibatch_size=64",
    "model.dtype=float32",
]


def gradients(training):
    return {n: each.grad.clone() for n, each in training.learner.loss.named_parameters() if each.grad is not None}


def test_kinds_have_their_share_of_the_worlds_and_seeds_of_their_own(tmp_path):
    training = tiny(tmp_path, *THREE, "seed=3")
    assert [task.name for task in training.tasks] == ["one", "two", "large"]
    assert [task.weight for task in training.tasks] == [0.25, 0.5, 0.25]
    seeds = torch.cat([task.env.seeds for task in training.tasks])
    assert seeds.tolist() == list(range(first_world_seed(3), first_world_seed(3) + 8))
    assert [task.env.n_agents for task in training.tasks] == [1, 2, 4]
    assert len({id(task.learner.loss) for task in training.tasks}) == 1
    assert len({id(task.learner.optimizer) for task in training.tasks}) == 1


def test_the_gradient_is_the_mean_of_the_kinds_gradients_by_their_shares(tmp_path, monkeypatch):
    training = tiny(tmp_path, *THREE, "algorithm.value_norm=false")
    optimizer = training.learner.optimizer
    for task, batch in zip(training.tasks, next(training.batches()), strict=True):
        task.learner.store(batch)
    samples = [next(iter(task.learner.samples())) for task in training.tasks]
    alone = []
    for task, sample in zip(training.tasks, samples, strict=True):
        terms = task.learner.terms(sample.clone())
        optimizer.zero_grad()
        sum(terms[key] for key in task.learner.loss_keys).backward()
        alone.append(gradients(training))
    optimizer.zero_grad()
    monkeypatch.setattr(torch.nn.utils, "clip_grad_norm_", lambda *_: torch.ones(()))
    monkeypatch.setattr(training._steps, "take", lambda *_: None)
    monkeypatch.setattr(optimizer, "zero_grad", lambda: None)
    training._update(*samples)
    for name, found in gradients(training).items():
        expected = 0.25 * alone[0][name] + 0.5 * alone[1][name] + 0.25 * alone[2][name]
        assert torch.allclose(found, expected, rtol=1e-4, atol=1e-6), name


def test_every_sample_of_every_kind_is_learned_from_once_a_pass(tmp_path):
    training = tiny(tmp_path, *THREE, "algorithm.epochs=1")
    for task, batch in zip(training.tasks, next(training.batches()), strict=True):
        task.learner.store(batch)
    counts = [[len(sample) for sample in task.learner.samples()] for task in training.tasks]
    assert counts == [[16], [32], [16]]  # of 8 steps of 2, 4 and 2 worlds, in minibatches of 64 steps of all


def test_columns_tell_what_each_kind_saves(tmp_path, caplog):
    training = tiny(
        tmp_path,
        *THREE,
        "algorithm.epochs=1",
        "total_frames=128",
        "evaluation.interval=128",
        "evaluation.episodes=2",
        "evaluation.mode=best",
    )
    with caplog.at_level("INFO", logger="warp_torchrl"):
        training.train()
    (told,) = [each.message for each in caplog.records if "of each kind" in each.message]
    assert re.fullmatch(rf"on training fires, {training.mode}, .*: one 0\.\d+, two 0\.\d+, large 0\.\d+", told)
    found = rows(tmp_path)[-1]
    saved = [float(found[f"mixture/saved_{name}"]) for name in ("one", "two", "large")]
    assert float(found["world/saved"]) == pytest.approx(0.25 * saved[0] + 0.5 * saved[1] + 0.25 * saved[2])
    of_kinds = [float(found[f"evaluation/saved_{name}"]) for name in ("one", "two", "large")]
    assert float(found["evaluation/saved"]) == pytest.approx(sum(of_kinds) / 3)
    assert len(set(of_kinds)) == 3


@needs("values")
def test_evaluations_on_the_way_tell_the_goal_too(tmp_path):
    keys = ["mechanics.values={}", "goal=fire_size", "total_frames=32", "evaluation.interval=32"]
    tiny(tmp_path, *keys, "evaluation.episodes=2").train()
    found = rows(tmp_path)[-1]
    assert float(found["evaluation/fire_size"]) > 1.0 > float(found["evaluation/saved"])


def test_rewards_are_normalised_kind_by_kind(tmp_path):
    training = tiny(tmp_path, *THREE, "reward.normalise=true")
    batches = next(training.batches())
    expected = []
    for batch in batches:
        scale = type(training.tasks[0].reward_scale)(training.run_config.reward.gamma)
        scale(other := batch.clone())
        expected.append(other["next", *REWARD])
    training._learn(batches)
    for batch, reward in zip(batches, expected, strict=True):
        assert torch.equal(batch["next", *REWARD], reward)


def shape(scenario, *overrides):
    plan = run_config(plain(compose_config("train", [*TINY, f"scenario={scenario}", *overrides])))
    return signature(plan.make_env(1, 0))


@needs("radio")
def test_kinds_of_worlds_whose_messages_come_at_once_and_late_differ():
    prompt, late = (
        shape("default", "mechanics.radio.carries=graph", f"mechanics.radio.delay={each}") for each in (0, 2)
    )
    assert differing(prompt, late) == "mechanics.radio.delay" and joint([late, late]).is_late


def test_a_network_for_several_kinds_reads_whole_what_any_of_them_can_fill():
    seen = "observation=surroundings"
    ground, air, hills = shape("default", seen), shape("hetero", seen), shape("default", seen, "landscape.relief=200.0")
    assert differing(ground, air) is None and differing(ground, shape("default", seen, "team.n_agents=7")) is None
    assert differing(ground, shape("default", seen, "observation.radius=3")) == "observation view"
    assert joint([ground, ground]) == ground
    both = joint([ground, air, hills])
    for name in ("view", "picture"):
        told = zip(*(each.observation[name].content for each in (ground, air, hills)), strict=True)
        expected = tuple(each[0] if len(set(each)) == 1 else None for each in told)
        assert both.observation[name].content == expected
    assert both.observation["view"].content != ground.observation["view"].content


@pytest.mark.parametrize("index", [pytest.param(0, marks=pytest.mark.slow), 1])
def test_actors_remember_each_kind_apart(tmp_path, index):
    kinds = "mixture.kinds={one:{scenario:skirmish},two:{scenario:skirmish}}"

    def second_batch(name, beside):
        (tmp_path / name).mkdir()
        training = tiny(tmp_path / name, "mixture=several", kinds, "model.memory=8", "algorithm.minibatch_size=32")
        its, other, found = training.tasks[index], training.tasks[1 - index], []
        for task in (its, *([other] if beside else []), its):
            torch.manual_seed(0)
            found.append(training._batch(iter(task.collection)).clone())
        return found[-1]

    alone, beside = second_batch("alone", False), second_batch("beside", True)
    assert (alone["agents", "memory"][:, 0] != 0.0).any(), "it remembers its last batch"
    for key in (("agents", "memory"), ("agents", "action")):
        assert torch.equal(alone[key], beside[key])


def test_a_kind_s_teacher_may_weigh_more(tmp_path):
    losses = []
    for factor in (1, 3):
        training = tiny(
            tmp_path,
            *THREE,
            f"mixture.kinds.two.teacher_weight={factor}",
            "imitation.teacher=local",
            "imitation.weight=0.5",
        )
        for task, batch in zip(training.tasks, next(training.batches()), strict=True):
            task.learner.store(batch)
        samples = [next(iter(task.learner.samples())) for task in training.tasks]
        losses.append([float(a.learner.terms(b)["loss_bc"]) for a, b in zip(training.tasks, samples, strict=True)])
    one, two, large = losses[0]
    assert losses[1] == pytest.approx([one, 3.0 * two, large], rel=1e-5)
