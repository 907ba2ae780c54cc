"""No world of a training is a world of another training, or of an evaluation."""

from itertools import pairwise

import pytest

from warp_torchrl.runs.checkpoint import newest
from warp_torchrl.runs.config.building import run_config
from warp_torchrl.runs.config.compose import compose_config
from warp_torchrl.runs.config.construction import ConfigError
from warp_torchrl.runs.config.plain_values import plain
from warp_torchrl.runs.config.saved_config import SavedConfig
from warp_torchrl.runs.config.seeds import (
    BEYOND_EVALUATION,
    FIRST_EVALUATED,
    MOST_WORLDS,
    SEEDS,
    WORLDS,
    first_world_seed,
)
from warp_torchrl.training.loop import Training
from warp_torchrl.training.tasks import task_worlds


def worlds(seed):
    return range(first_world_seed(seed), first_world_seed(seed) + WORLDS)


def test_the_first_training_seeds_have_the_worlds_that_they_had():
    assert [first_world_seed(seed) for seed in (0, 1, 243)] == [0, 4096, 4096 * 243]


def test_training_and_evaluation_share_no_world():
    tried = [0, 1, 2, 242, 243, 244, 245, 1234, SEEDS - 1, SEEDS]
    for seed in tried:
        assert worlds(seed)[-1] < FIRST_EVALUATED or worlds(seed)[0] >= BEYOND_EVALUATION, seed
        assert worlds(seed)[-1] < 2**62, "what an environment takes"
    for before, after in pairwise(tried):
        assert worlds(before)[-1] < worlds(after)[0]


def test_trainings_of_many_worlds_share_none_with_another_training():
    last_of_few = worlds(SEEDS)[-1]
    for seed in (0, 1, SEEDS):
        first = first_world_seed(seed, WORLDS + 1)
        assert first == first_world_seed(seed, MOST_WORLDS) > last_of_few
        assert first + MOST_WORLDS <= min(first_world_seed(seed + 1, MOST_WORLDS), 2**62)
    assert first_world_seed(3, WORLDS) == first_world_seed(3)


def test_a_training_has_more_worlds_than_a_seed_owns(monkeypatch):
    monkeypatch.setattr("warp_torchrl.runs.config.seeds.WORLDS", 4)
    first = first_world_seed(2, 5)
    (training,) = task_worlds(run_config(plain(compose_config("train", ["seed=2", "n_worlds=5", "landscape.size=8"]))))
    assert training.env.state_dict()["seeds"].tolist() == list(range(first, first + 5))


def test_evaluations_end_before_the_worlds_of_training():
    last = [f"evaluation.first_seed={BEYOND_EVALUATION - 3}", "evaluation.episodes=3"]
    plan = run_config(plain(compose_config("train", last))).evaluation
    assert plan.first_seed + plan.episodes == BEYOND_EVALUATION
    with pytest.raises(ConfigError, match=r"evaluation\.first_seed must be in"):
        run_config(plain(compose_config("train", [last[0], "evaluation.episodes=4"])))


@pytest.mark.parametrize("seed", [1234, SEEDS])
def test_any_whole_number_is_a_seed(seed):
    plan = run_config(plain(compose_config("train", [f"seed={seed}", "landscape.size=12"])))
    env = plan.make_training_env(3, first_world_seed(plan.seed))
    assert env.reset()["done"].shape == (3, 1)


def test_a_run_of_a_large_seed_trains_and_finds_its_mode(tmp_path):
    small = ["landscape.size=8", "horizon=8", "n_worlds=2", "collector.steps=4", "total_frames=16"]
    small += ["algorithm.minibatch_size=8", "evaluation.episodes=2", "model.actor_hidden=[8]", "seed=2147483648"]
    run = Training(run_config(plain(compose_config("train", small))), SavedConfig(), tmp_path)
    run.train()
    assert run.env.state_dict()["seeds"].tolist() == list(worlds(SEEDS)[:2])
    assert newest(tmp_path)[0].manifest.mode in ("sampled", "deterministic")
