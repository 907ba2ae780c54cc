"""A teacher's choices are cloned at first, and forgotten at last."""

import math
from types import SimpleNamespace

import pytest
import torch
from tensordict import TensorDict
from torch import nn
from torch.nn.functional import cross_entropy
from torchrl.objectives import BCLoss

from warp_torchrl.collection.imitation import Imitation
from warp_torchrl.evaluation.method import method
from warp_torchrl.heuristics import HEURISTICS, TEACHERS
from warp_torchrl.models import ACTION, ACTION_MASK, LOGITS, TEACHER_ACTION, over_canonical
from warp_torchrl.runs.config.building import run_config
from warp_torchrl.runs.config.compose import compose_config
from warp_torchrl.runs.config.construction import ConfigError
from warp_torchrl.runs.config.plain_values import plain
from warp_torchrl.runs.config.saved_config import SavedConfig
from warp_torchrl.training.kickstarting import _KickstartingLoss, kickstart
from warp_torchrl.training.loop import Training

TINY = [
    "landscape.size=12",
    "horizon=20",
    "n_worlds=8",
    "collector.steps=8",
    "total_frames=640",
    "evaluation.episodes=4",
    "algorithm.minibatch_size=32",
    "model.actor_hidden=[16]",
    "model.critic_hidden=[16]",
]


def configured(*overrides):
    return run_config(plain(compose_config("train", [*TINY, *overrides])))


def student(folder, *overrides):
    return Training(configured("imitation.teacher=greedy", *overrides), SavedConfig(), folder)


def test_the_teacher_tells_what_it_would_do_in_the_pupils_states(tmp_path):
    training = student(tmp_path)
    teacher = HEURISTICS["greedy"](training.env)
    now = training.env.reset()
    for _ in range(5):
        expected = teacher.choose(training.env.world_state, now[ACTION_MASK])
        training.learner.explore(now)
        assert torch.equal(now[TEACHER_ACTION], expected)
        assert not torch.equal(now[ACTION], expected), "the student acts"
        now = training.env.step(now)["next"]


def test_the_lesson_falls_to_nothing(tmp_path):
    training = student(tmp_path, "imitation.weight=2.0", "imitation.until=0.5")
    sample = sample_of(training)
    whole = {}
    for progress in (0.0, 0.125, 0.25, 0.5, 1.0):
        training.learner.schedule(progress)
        whole[progress] = float(training.learner.terms(sample.clone())["loss_bc"])
    assert whole[0.0] > 1.0
    assert whole[0.125] == pytest.approx(0.75 * whole[0.0]) and whole[0.25] == pytest.approx(0.5 * whole[0.0])
    assert whole[0.5] == whole[1.0] == 0.0
    now = training.env.reset()
    training.learner.explore(now)
    assert torch.equal(now[TEACHER_ACTION], now[ACTION]), "it is no longer asked"


def test_a_factor_on_the_weight_stays_on_it_as_it_falls():
    learner = SimpleNamespace(
        loss=SimpleNamespace(actor_network=[nn.Identity()]), schedule=lambda progress: {"train/rate": progress}
    )
    lesson = _KickstartingLoss(Imitation(teacher="greedy", weight=2.0, weight_end=0.5, until=0.5), learner, 3.0)
    assert lesson.weight == 6.0
    assert lesson.schedule(0.25) == {"train/rate": 0.25} and lesson.weight == 3.0 * 1.25
    lesson.schedule(1.0)
    assert lesson.weight == 3.0 * 0.5


def sample_of(training):
    """What the learner learns from, of one batch."""
    training.learner.store(next(iter(training.collection)))
    return next(iter(training.learner.samples()))


def test_the_cloning_loss_by_hand(tmp_path):
    training = student(tmp_path)
    sample = sample_of(training)
    actor = over_canonical(training.learner.policy[0])
    logits = actor(sample.select(*actor.in_keys))[LOGITS]
    by_hand = [
        math.log(sum(math.exp(each) for each in row)) - row[int(choice)]
        for row, choice in zip(logits.flatten(0, 1).tolist(), sample[TEACHER_ACTION].flatten(), strict=True)
    ]
    terms = training.learner.terms(sample)
    assert float(terms["loss_bc"]) == pytest.approx(sum(by_hand) / len(by_hand), rel=1e-5)
    terms["loss_bc"].backward()
    moved = {name for name, each in training.learner.loss.named_parameters() if each.grad is not None}
    assert moved and all(name.startswith("actor") for name in moved), "critics have no teacher"


@pytest.mark.filterwarnings("ignore")  # TorchRL's, of a target network that it declares and does not make
def test_the_cloning_loss_is_torchrls(tmp_path):
    """Of the same network and choices: its value and its gradients, though it takes no pass of its own."""
    training = student(tmp_path, "model.symmetry=none")
    sample, actor = sample_of(training), training.learner.policy[0]
    theirs = BCLoss(actor, loss_function=lambda said, chosen: cross_entropy(said.flatten(0, -2), chosen.flatten()))
    theirs.set_keys(action=LOGITS)
    expected = theirs(sample.select(*actor.in_keys).set(LOGITS, sample[TEACHER_ACTION]))["loss_bc"]
    ours = training.learner.terms(sample)["loss_bc"]
    assert float(ours) == pytest.approx(float(expected), rel=1e-6)
    ours.backward()
    learnt = dict(training.learner.loss.actor_network_params.flatten_keys(".").items())
    expected.backward()
    for name, weight in theirs.actor_network_params.flatten_keys(".").items():
        torch.testing.assert_close(learnt["module.0." + name].grad, weight.grad, rtol=1e-5, atol=1e-7)


def test_the_learners_own_terms_and_state_stay_as_they_are(tmp_path):
    taught, alone = student(tmp_path), Training(configured(), SavedConfig(), tmp_path)
    sample = sample_of(taught)
    mine, theirs = taught.learner.terms(sample.clone()), alone.learner.terms(sample.clone())
    assert isinstance(mine, TensorDict) and set(mine.keys()) - set(theirs.keys()) == {"loss_bc"}
    for name, value in theirs.items():
        assert torch.equal(mine[name], value), name
    assert set(taught.state_dict()["loss"]) == set(alone.state_dict()["loss"])


@pytest.mark.slow
def test_a_pupil_comes_to_do_what_its_teacher_does(tmp_path):
    training = student(tmp_path, "total_frames=960", "imitation.until=1.0", "algorithm.epochs=4")
    agreed = []
    for batch in training.collection:
        agreed.append(float((batch[ACTION] == batch[TEACHER_ACTION]).float().mean()))
        training._learn([batch])
        if training.frames >= 960:
            break
    early, late = sum(agreed[:5]) / 5, sum(agreed[-5:]) / 5
    assert early < 0.25 and late > 1.6 * early, (early, late)  # a policy without a teacher stays at one in nine


@pytest.mark.parametrize(
    ("overrides", "said"),
    [
        (["imitation.teacher=nobody"], r"imitation.teacher must be null or one of .*coordinated.*, got nobody"),
        (["imitation.teacher=ring"], r"imitation.teacher must be null or one of .*, got ring"),
        (["imitation.teacher=greedy", "algorithm=dqn"], r"imitation.teacher must be null where the algorithm replays"),
        (["imitation.teacher=greedy", "collector=process"], r"imitation.teacher must be null where workers collect"),
        (["imitation.until=0"], r"imitation.until must be in"),
        (["imitation.weight=nan"], r"imitation.weight must be"),
    ],
)
def test_a_lesson_that_cannot_be_is_refused_in_one_line(overrides, said):
    with pytest.raises(ConfigError, match=said) as error:
        configured(*overrides)
    assert "\n" not in str(error.value)


def test_teachers_do_not_remember():
    assert {"local", "greedy", "coordinated"} <= set(TEACHERS)
    assert not {"ring", "mixed"} & set(TEACHERS), "a plan made for other states is no advice"


def test_without_a_teacher_the_learner_is_as_it_was(tmp_path):
    training = Training(configured(), SavedConfig(), tmp_path)
    assert kickstart(training.learner, Imitation(), training.env) is training.learner


def test_a_policy_with_a_teacher_is_called_so():
    record = SavedConfig(choices={"algorithm": "mappo", "reward": "time", "observation": "local"}, values={"seed": 1})
    taught = SavedConfig(choices=record.choices, values={"seed": 2, "imitation": {"teacher": "greedy", "until": 0.3}})
    as_floats = SavedConfig(
        choices=record.choices, values={"seed": 1, "sizes": [1.0], "reward": {"act": 0.0}, "on": True}
    )
    as_integers = SavedConfig(
        choices=record.choices, values={"seed": 2, "sizes": [1], "reward": {"act": 0}, "on": True}
    )
    assert method(as_floats) == method(as_integers) != method(record)
    assert method(record)[0] == "mappo time local" and method(taught)[0] == "mappo time local taught by greedy"
