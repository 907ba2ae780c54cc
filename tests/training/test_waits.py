"""An iteration of training waits for a GPU three times at most: for its starts, its metrics and what it learned."""

import pytest
import torch

from warp_torchrl.benchmark.waits import counted_waits
from warp_torchrl.runs.config.building import run_config
from warp_torchrl.runs.config.compose import compose_config
from warp_torchrl.runs.config.plain_values import plain
from warp_torchrl.runs.config.saved_config import SavedConfig
from warp_torchrl.system.device import unread
from warp_torchrl.training.loop import Training

SMALL = ["n_worlds=8", "landscape.size=12", "horizon=20", "model.actor_hidden=[8]", "model.critic_hidden=[8]"]
"""Episodes of at most 20 steps: every world starts anew at least once in 32."""
DEVICE = "cuda" if torch.cuda.is_available() else "cpu"


def training(folder, *overrides):
    values = plain(compose_config("train", [*SMALL, f"device={DEVICE}", *overrides]))
    return Training(run_config(values), SavedConfig(), folder)


@pytest.mark.parametrize(
    "overrides",
    [
        [],
        pytest.param(["algorithm=ippo", "wind=wandering"], marks=pytest.mark.slow),
        pytest.param(["scenario=lightning", "reward.normalise=true"], marks=pytest.mark.slow),
        pytest.param(
            ["fire=paper", "landscape.relief=200", "observation=paper", "model.symmetry=none"], marks=pytest.mark.slow
        ),
        pytest.param(["experiment=skirmish"], marks=pytest.mark.slow),
        ["algorithm=a2c", "fire=hazard"],
    ],
    ids=" ".join,
)
def test_an_iteration_waits_three_times_at_most(tmp_path, overrides):
    with unread():
        run = training(tmp_path, *overrides)
        batches = run.batches()
        run._learn(next(batches))
        with counted_waits(DEVICE) as waits:
            row = run._learn(next(batches))
        run.close()
    assert waits.count <= 3, waits.places
    assert row["world/saved"] is not None and row["train/loss"] is not None


def test_a_step_and_an_update_do_not_wait(tmp_path):
    with unread():
        run = training(tmp_path)
        [batch] = next(run.batches())
        shown, learner = run.env.reset(), run.learner
        learner.store(batch)
        sample = next(iter(learner.samples()))
        run._update(sample)
        with counted_waits(DEVICE) as waits:
            for _ in range(20):
                _, shown = run.env.step_and_maybe_reset(learner.explore(shown))
            run._update(sample)
        run.close()
    filled = sum(count for place, count in waits.places.items() if place.startswith("reset_pool.py"))
    assert filled <= 1 and waits.count == filled, waits.places


def test_the_same_is_learned_without_reading(tmp_path):
    """The dense backends and masks of a GPU compute what a CPU computes, but for the last digits of sums."""

    def two_iterations():
        run = training(tmp_path)
        batches = run.batches()
        rows = [run._learn(next(batches)) for _ in range(2)]
        run.close()
        return rows, run.env.state_dict()

    rows, worlds = two_iterations()
    with unread():
        unread_rows, unread_worlds = two_iterations()
    assert torch.equal(worlds["episodes"], unread_worlds["episodes"])
    assert torch.equal(worlds["worlds"]["cells"], unread_worlds["worlds"]["cells"])
    for one, other in zip(rows, unread_rows, strict=True):
        known = {name: value for name, value in one.items() if value is not None}
        assert known == pytest.approx({name: other[name] for name in known}, rel=1e-4, abs=1e-6)
