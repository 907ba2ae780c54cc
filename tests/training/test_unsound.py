"""Numbers that are not finite end every learner before its weights are touched, wherever they come from."""

import math

import pytest
import torch

from tests.training.test_loop import ALGORITHMS, RUNS, TINIER, tiny
from warp_torchrl.commands.failure import NUMERICAL, fail
from warp_torchrl.evaluation.play import play
from warp_torchrl.models import LOGITS, OBSERVATION, REWARD, signature
from warp_torchrl.runs.checkpoint import newest
from warp_torchrl.runs.policies.trained import TrainedPolicy
from warp_torchrl.system.finite import NumericalFailure, are_unsound, check_scores

NAN, INF = math.nan, math.inf
LEARNERS = [each for each in (*ALGORITHMS, "remembers", "taught", "talks late", "regrets") if each in RUNS]
SAME = ("ippo", "ppo", "vdn", "regrets")
"""Learners that take in a batch as another one does: ``mappo``, or ``dqn``."""
BAD = {
    "an observation": [((*OBSERVATION, "status"), NAN), (("next", *OBSERVATION, "status"), INF), ("state", -INF)],
    "a reward": [(("next", *REWARD), NAN)],
}


def learned(training):
    """Copies of all that learning changes."""
    state = training.learner.loss.state_dict()
    return {name: value.clone() for name, value in state.items() if isinstance(value, torch.Tensor)}


def refused(training, batch, what):
    """Check that nothing is learned from a batch, and return the line."""
    before = learned(training)
    with pytest.raises(
        NumericalFailure, match=f"^after {training.frames} frames {what} is not finite; the last"
    ) as told:
        training._learn([batch])
    assert all(torch.equal(value, before[name]) for name, value in learned(training).items())
    replay = training.learner.keeps.get("replay")
    assert replay is None or not len(replay.buffer), "and nothing of it is remembered"
    return told.value


@pytest.mark.parametrize(
    "name", [pytest.param(each, marks=pytest.mark.slow) if each in SAME else each for each in LEARNERS]
)
def test_no_learner_takes_in_what_is_not_finite(tmp_path, name):
    training = tiny(tmp_path, *TINIER, *RUNS[name])
    batch = next(training.batches())[0].clone()
    for what, places in BAD.items():
        for key, number in places:
            poisoned = batch.clone()
            poisoned[key].view(-1)[3] = number
            refused(training, poisoned, what)
    # Weights that are finite and whose products are not: agents act on, and the batch tells.
    with torch.no_grad():
        for weight in training.learner.policy.parameters():
            weight.mul_(0.0).add_(1e38)
    overflowed = next(iter(training.collection))
    error = refused(training, overflowed, "an output of the policy")
    assert fail(error, debug=False)[0] == NUMERICAL == 5


def test_a_first_batch_that_is_bad_where_agents_look_ends_a_training(tmp_path):
    """What is shown is bad while it is collected: chances are NaN, and the run still ends with its own line."""
    training = tiny(tmp_path, *TINIER)
    act, steps = training.env._acted, iter(range(1000))

    def poisoned(*given):
        shown = act(*given)
        if next(steps) == 5:
            shown["agents"]["observation"]["status"][1] = NAN
        return shown

    training.env._acted = poisoned
    with pytest.raises(NumericalFailure, match="after 16 frames an observation is not finite"):
        training.train()
    assert not (tmp_path / "checkpoints").exists()


def test_weights_that_are_not_finite_are_not_saved(tmp_path):
    training = tiny(tmp_path, *TINIER)
    training.save()
    training.frames = 32
    with torch.no_grad():
        next(training.learner.policy.parameters()).view(-1)[2] = NAN
    with pytest.raises(NumericalFailure, match=r"after 32 frames .*weight is not finite; it is not saved"):
        training.save()
    assert newest(tmp_path)[0].manifest.frames == 0


@pytest.mark.parametrize("mode", ["sampled", "deterministic"])
@pytest.mark.parametrize("name", ["mappo", "dqn", "ddpg"])
def test_a_policy_whose_numbers_overflow_does_not_act(tmp_path, name, mode):
    training = tiny(tmp_path, *TINIER, *RUNS[name])
    policy = TrainedPolicy(training.learner.policy, mode, signature(training.env))
    shown = training.env.reset()
    assert policy(shown.clone())["agents", "action"].shape == (4, 2)
    with torch.no_grad():
        for weight in policy.parameters():
            weight.mul_(0.0).add_(1e38)
    with pytest.raises(NumericalFailure, match=r"the policy scores an action [-+a-z0-9]+, no number"):
        policy(shown.clone())
    with pytest.raises(NumericalFailure, match="the policy scores an action"):
        play(training.env, policy.module, 0, mode)


def test_what_is_unsound_is_found_without_a_sum():
    large = torch.full((9,), 3e38)  # whose sum is not finite
    assert not are_unsound([large, torch.zeros(0), torch.zeros(2, dtype=torch.float64)])
    for number in (NAN, INF, -INF):
        assert are_unsound([large, torch.tensor([0.0, number])])
    assert not are_unsound([])


def test_a_draw_among_chances_that_are_no_numbers_is_an_action_and_leaves_them(tmp_path):
    training = tiny(tmp_path, *TINIER)
    shown = training.env.reset()
    expected = training.learner.policy(shown.clone())
    shown[(*OBSERVATION, "status")][2] = NAN
    torch.manual_seed(0)
    acted = training.learner.policy(shown.clone())
    assert ((acted["agents", "action"] >= 0) & (acted["agents", "action"] < 11)).all()
    assert acted[LOGITS][2].isnan().all() and acted[LOGITS][0].equal(expected[LOGITS][0])


def test_scores_are_refused_from_the_square_root_of_the_largest_number_on():
    closed = torch.finfo(torch.float32).min
    check_scores(None)
    check_scores(torch.zeros(0, 11))
    check_scores(torch.tensor([[closed, 1.7e19, -1e30]]))
    for bad in (NAN, INF, -INF, 1.9e19, 1e37):
        with pytest.raises(NumericalFailure, match="no number to act by"):
            check_scores(torch.tensor([[closed, 0.0], [bad, 1.0]]))
