"""A recorded update is the update, and a GPU can record it."""

import pytest
import torch
from torch.fx.experimental.proxy_tensor import make_fx

from tests.training.test_waits import training
from warp_torchrl.runs.config.building import run_config
from warp_torchrl.runs.config.compose import compose_config
from warp_torchrl.runs.config.construction import ConfigError
from warp_torchrl.runs.config.plain_values import plain
from warp_torchrl.system.device import unread
from warp_torchrl.training.finite import NumericalFailure
from warp_torchrl.training.recorded import RecordedUpdate


def learned(folder, *overrides):
    """Rows and weights after two batches."""
    with unread():
        run = training(folder, *overrides)
        batches = run.batches()
        rows = [run._learn(next(batches)) for _ in range(2)]
        run.close()
    return rows, [each.detach().clone() for each in run.learner.loss.parameters()], run


MORE = [["algorithm=a2c"], ["algorithm.minibatch_size=100"]]


@pytest.mark.parametrize("overrides", [[], *(pytest.param(each, marks=pytest.mark.slow) for each in MORE)], ids=str)
def test_recorded_updates_learn_the_same_at_a_rate_that_falls(tmp_path, overrides):
    rows, weights, _ = learned(tmp_path, "collector.grows_at=0", "total_frames=560", *overrides)
    recorded_rows, recorded, run = learned(tmp_path, "graph=true", "total_frames=560", *overrides)
    rate = run.learner.optimizer.param_groups[0]["lr"]
    assert isinstance(rate, torch.Tensor) and float(rate) == pytest.approx(1e-3 * (1.0 - 0.95 * 512 / 560))
    assert isinstance(run._update, RecordedUpdate) and run.env._recorded is not None
    for one, other in zip(rows, recorded_rows, strict=True):
        known = {name: value for name, value in one.items() if value is not None}
        assert known == pytest.approx({name: other[name] for name in known}, rel=1e-3, abs=1e-3)
    for weight, other in zip(weights, recorded, strict=True):
        torch.testing.assert_close(weight, other, rtol=1e-3, atol=1e-4)


def test_a_recorded_update_refuses_what_is_not_finite(tmp_path):
    with unread():
        run = training(tmp_path, "graph=true")
        [batch] = next(run.batches())
        run.learner.store(batch)
        for sample in run.learner.samples():
            weights = [each.detach().clone() for each in run.learner.loss.parameters()]
            run._update(sample)
            assert any((one != each).any() for one, each in zip(weights, run.learner.loss.parameters(), strict=True))
            weights = [each.detach().clone() for each in run.learner.loss.parameters()]
            run._update(sample.set(("agents", "advantage"), sample["agents", "advantage"] * float("nan")))
            break
        with pytest.raises(NumericalFailure, match="not finite"):
            run._steps.read({}, 0)
        run.close()
    for weight, now in zip(weights, run.learner.loss.parameters(), strict=True):
        assert torch.equal(weight, now)


def test_no_size_in_loss_and_gradients_depends_on_a_result(tmp_path):
    with unread():
        run = training(tmp_path, "model.dtype=float32")
        learner = run.learner
        learner.store(next(run.batches())[0])
        sample = next(iter(learner.samples()))
        run._update(sample)
        names, leaves = zip(*sample.flatten_keys(".").items())
        weights = [each for each in learner.loss.parameters() if each.requires_grad]

        def gradients(*tensors):
            again = sample.flatten_keys(".").empty()
            for name, tensor in zip(names, tensors, strict=True):
                again.set(name, tensor)
            terms = learner.terms(again.unflatten_keys("."))
            return torch.autograd.grad(sum(terms[key] for key in learner.loss_keys), weights)

        traced = make_fx(gradients, tracing_mode="fake", _allow_non_fake_inputs=True)(*leaves)
        run.close()
    assert len(traced.graph.nodes) > 100


@pytest.mark.parametrize(
    "overrides", [[], ["algorithm=dqn"], ["imitation.teacher=coordinated"], ["model.memory=8"], ["collector=process"]]
)
def test_graphs_are_refused_where_they_cannot_be(overrides, monkeypatch):
    plan = run_config(plain(compose_config("train", ["graph=true", "processes=1", *overrides])))
    if overrides:
        object.__setattr__(plan, "device", "cuda")
        monkeypatch.setattr(torch.cuda, "device_count", lambda: 1)
    with pytest.raises(ConfigError, match="graph must be false"):
        plan.check_training()
