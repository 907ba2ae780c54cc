"""What each kind of a mixture counts, in a training."""

import pytest

from tests.training.test_loop import rows, tiny
from tests.training.test_tasks import THREE
from warp_torchrl.collection.mixture import Mixture, weights
from warp_torchrl.evaluation.play import play_heuristics
from warp_torchrl.runs.config.seeds import first_world_seed
from warp_torchrl.training.weighing import Weighing

NAMES = ("one", "two", "large")


def test_weights_follow_what_was_saved_before_a_batch(tmp_path):
    training = tiny(
        tmp_path, *THREE, "algorithm.epochs=1", "total_frames=256", "mixture.weigh=left", "mixture.worlds=3", "seed=2"
    )
    first = first_world_seed(2)
    baseline = [
        play_heuristics(training.run_config.make_env(3, first, world=kind.world), first, ("coordinated",))
        for kind in training.run_config.kinds
    ]
    baseline = [float(each["coordinated"]["saved"].mean()) for each in baseline]
    assert training.weighing.baseline == pytest.approx(baseline)
    training.train()
    expected, saved = [], [None, None, None]
    for row in rows(tmp_path):
        expected.append(weights([0.25, 0.5, 0.25], saved, baseline, 0.25))
        now = [float(row[f"mixture/saved_{name}"]) for name in NAMES]
        saved = now if saved[0] is None else [0.8 * old + 0.2 * new for old, new in zip(saved, now, strict=True)]
    found = [[float(row[f"mixture/weight_{name}"]) for name in NAMES] for row in rows(tmp_path)]
    assert len(found) == 4
    assert all(now == pytest.approx(then) for now, then in zip(found, expected, strict=True))
    assert [task.weight for task in training.tasks] == pytest.approx(training.weighing.weights())
    assert found[0] == [0.25, 0.5, 0.25] and found[1] != pytest.approx(found[0])


def test_a_kind_of_which_no_episode_ended_keeps_what_was_saved():
    told = Weighing(Mixture(weigh="left"), ("a", "b"), (0.5, 0.5), (0.8, 0.8))
    told.columns({"mixture/saved_a": 0.4, "mixture/saved_b": None})
    told.columns({"mixture/saved_a": None, "mixture/saved_b": 0.2})
    assert told.saved == [0.4, 0.2]


def test_shares_stand_unless_asked(tmp_path):
    assert tiny(tmp_path, *THREE).weighing is None
    assert tiny(tmp_path).weighing is None
