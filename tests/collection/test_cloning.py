"""What people did is cloned beside reinforcement, and the minibatches go on where a checkpoint left them."""

import csv

import pytest
import torch

from tests.demonstrations.played import SMALL, played
from warp_torchrl.collection.cloning import AGENT
from warp_torchrl.demonstrations.files import save_recording
from warp_torchrl.models import ACTION, ACTION_MASK, LOGITS, OBSERVATION
from warp_torchrl.runs.checkpoint import CheckpointError, newest
from warp_torchrl.runs.config.building import run_config
from warp_torchrl.runs.config.compose import compose_config
from warp_torchrl.runs.config.plain_values import plain, without_targets
from warp_torchrl.runs.config.saved_config import SavedConfig
from warp_torchrl.training.loop import Training

TINY = [
    *SMALL,
    "n_worlds=8",
    "collector.steps=8",
    "collector.grows_at=0",
    "total_frames=640",
    "evaluation.episodes=4",
    "evaluation.mode=sampled",
    "algorithm.minibatch_size=32",
    "model.actor_hidden=[16]",
    "model.critic_hidden=[16]",
    "model.dtype=float32",
    "imitation.minibatch_size=64",
]


@pytest.fixture(scope="module")
def several():
    return [played(seed=seed) for seed in range(4)]


@pytest.fixture(scope="module")
def people(several, tmp_path_factory):
    folder = tmp_path_factory.mktemp("people")
    for each in several:
        save_recording(each, folder)
    return folder


def learning(run, people, *overrides):
    """A training that learns from people."""
    config = plain(compose_config("train", [*TINY, f"imitation.demonstrations={people}", *overrides]))
    return Training(run_config(config), SavedConfig(choices={}, values=without_targets(config)), run)


def sample_of(training):
    training.learner.store(next(iter(training.collection)))
    return next(iter(training.learner.samples()))


def cloning_of(training):
    return training.learner.terms.__self__


@torch.no_grad()
def likelihood(training, people_s):
    """The mean log-likelihood of recorded acts, from logits of the whole policy on what was recorded, by hand."""
    found = []
    for each in people_s:
        steps = each.steps
        shown = steps.select(OBSERVATION, ACTION_MASK, ("agents", "role")).clone()
        logits = training.learner.policy[0](shown)[LOGITS].masked_fill(~steps[ACTION_MASK], -torch.inf)
        found.append(logits.log_softmax(-1).gather(-1, steps[ACTION][..., None])[..., 0])
    return torch.cat(found)


@pytest.mark.parametrize(
    "overrides",
    [
        ["algorithm=mappo"],
        ["algorithm=a2c", "model.symmetry=none"],
        ["algorithm=ippo", "model.sharing=none"],
        ["model.sharing=role", "model=cnn"],
    ],
    ids=" ".join,
)
def test_the_loss_by_hand(overrides, several, people, tmp_path):
    training = learning(tmp_path, people, "imitation.weight=2.0", *overrides)
    for each in training.learner.policy.parameters():
        torch.nn.init.normal_(each, std=0.1)
    cloning = cloning_of(training)
    everything = cloning.minibatches.given.acts
    by_hand = likelihood(training, several)
    assert len(everything) == by_hand.numel() and by_hand.std() > 0.01
    found = cloning._log_prob(everything)
    torch.testing.assert_close(found.flatten(), by_hand.flatten(), rtol=1e-4, atol=1e-5)
    cloning.minibatches.draw = lambda: everything
    terms = training.learner.terms(sample_of(training))
    assert float(terms["loss_bc"]) == pytest.approx(-2.0 * float(by_hand.mean()), rel=1e-4)
    terms["loss_bc"].backward()
    moved = {name for name, each in training.learner.loss.named_parameters() if each.grad is not None}
    assert moved and all(name.startswith("actor") for name in moved), "critics have nobody to clone"


def test_an_act_trains_its_own_agent_s_network_alone(people, tmp_path):
    training = learning(tmp_path, people, "model.sharing=none")
    cloning = cloning_of(training)
    acts = cloning.minibatches.given.acts
    cloning._log_prob(acts[acts[AGENT][:, 0] == 1]).sum().backward()
    trained = {
        name.split("networks.")[1][0] if "networks." in name else name.split("networks_")[1][0]
        for name, each in training.learner.loss.named_parameters()
        if each.grad is not None and bool(each.grad.any())
    }
    assert trained == {"1"}


def test_a_teacher_s_loss_is_added(people, tmp_path):
    both, alone = (
        learning(tmp_path, people, *overrides)
        for overrides in (["imitation.teacher=greedy"], ["imitation.teacher=greedy", "imitation.demonstrations=null"])
    )
    cloning = cloning_of(both)
    cloning.minibatches.draw = lambda: cloning.minibatches.given.acts
    sample = sample_of(both)
    of_both, of_teacher = (each.learner.terms(sample.clone())["loss_bc"] for each in (both, alone))
    people_s = -cloning._log_prob(cloning.minibatches.given.acts).mean()
    assert float(of_both) == pytest.approx(float(of_teacher + people_s), rel=1e-5) and float(people_s) > 1.0
    assert both.learner.loss_keys.count("loss_bc") == 1


def test_the_lesson_falls_to_nothing_and_then_draws_nothing(people, tmp_path):
    training = learning(tmp_path, people, "imitation.until=0.5")
    cloning, sample = cloning_of(training), sample_of(training)
    cloning.minibatches.draw = lambda: cloning.minibatches.given.acts
    whole = {}
    for progress in (0.0, 0.25, 0.5):
        training.learner.schedule(progress)
        whole[progress] = float(training.learner.terms(sample.clone())["loss_bc"])
    assert whole[0.25] == pytest.approx(0.5 * whole[0.0]) and whole[0.0] > 1.0 and whole[0.5] == 0.0
    before = cloning.minibatches.state_dict()["random"]
    del cloning.minibatches.draw
    training.learner.terms(sample.clone())
    assert torch.equal(cloning.minibatches.state_dict()["random"], before)


def rows(run):
    with (run / "metrics.csv").open(newline="") as file:
        return list(csv.DictReader(file))


@pytest.mark.slow
def test_a_policy_comes_to_do_what_people_did(several, people, tmp_path):
    training = learning(tmp_path, people, "total_frames=1280", "imitation.until=1.0", "imitation.weight=5")
    before = float(likelihood(training, several).exp().mean())
    training.train()
    after = float(likelihood(training, several).exp().mean())
    losses = [float(row["train/cloning_loss"]) for row in rows(tmp_path)]
    assert losses[-1] < losses[0], "though its weight falls, too"
    assert before < 0.25 and after > 2.0 * before, (before, after)


def trained(run, people, stop_after=None):
    training = learning(run, people, "total_frames=256", "imitation.until=0.8")
    if stop_after is None:
        training.train()
        return training
    batches = training.batches()
    for _ in range(stop_after):
        training.metrics.add({"time/frames": 0, "time/seconds": 0.0, "time/fps": 0.0, **training._learn(next(batches))})
    training.save()
    return training


def weights(training):
    return dict(training.learner.loss.state_dict())


def test_a_run_resumed_equals_a_run_not_interrupted(people, tmp_path):
    for name in ("whole", "again", "cut"):
        (tmp_path / name).mkdir()
    whole, again = trained(tmp_path / "whole", people), trained(tmp_path / "again", people)
    trained(tmp_path / "cut", people, stop_after=2)
    torch.manual_seed(123)
    resumed = learning(tmp_path / "cut", people, "total_frames=256", "imitation.until=0.8")
    resumed.load_state_dict(newest(tmp_path / "cut")[0].training())
    resumed.train()
    for name, value in weights(whole).items():
        assert torch.equal(weights(again)[name], value), f"{name} of the same seed"
        assert torch.equal(weights(resumed)[name], value), name
    one, other = (each.learner.keeps["demonstrations"].state_dict()["random"] for each in (whole, resumed))
    assert torch.equal(one, other)


def test_another_seed_draws_other_minibatches(people, tmp_path):
    first, second = (cloning_of(learning(tmp_path, people, f"seed={seed}")).minibatches.draw() for seed in (0, 1))
    assert first.shape == (64,) and not torch.equal(first[ACTION], second[ACTION])


def test_a_run_goes_on_with_no_other_recordings(people, tmp_path):
    trained(tmp_path, people, stop_after=1)
    other = tmp_path / "others"
    save_recording(played(seed=9), other)
    with pytest.raises(CheckpointError, match=r"imitation.demonstrations must hold the recordings that the run began"):
        learning(tmp_path, other, "total_frames=256").load_state_dict(newest(tmp_path)[0].training())


def test_without_demonstrations_the_learner_is_as_it_was(people, tmp_path):
    plain_one, cloning = learning(tmp_path, "null"), learning(tmp_path, people)
    assert "demonstrations" not in plain_one.learner.keeps and "loss_bc" not in plain_one.learner.loss_keys
    sample = sample_of(cloning)
    mine, theirs = cloning.learner.terms(sample.clone()), plain_one.learner.terms(sample.clone())
    for name, value in theirs.items():
        assert torch.equal(mine[name], value), name
