"""A training's way through its curriculum, as ``metrics.csv`` and its worlds tell it."""

import pytest
import torch

from tests.training.test_loop import REPLAY, rows, tiny
from warp_torchrl.runs.checkpoint import newest
from warp_torchrl.training.evaluations import EvaluationsOnTheWay

CLIMBS = [
    "curriculum=success",
    "curriculum.over.steps_per_tick=[9,6,1]",
    "curriculum.over.horizon=[12,16,20]",
    "curriculum.episodes=4",
    "curriculum.low=0.01",
    "curriculum.high=0.02",
]
"""Everything is mastered at once."""


def numbers(run, name):
    return [None if row[name] == "" else float(row[name]) for row in rows(run)]


@pytest.mark.slow
def test_rows_tell_the_levels_their_chances_and_how_the_team_did(tmp_path):
    tiny(tmp_path, *CLIMBS, "curriculum.floor=0.25", "curriculum.until=0.8", "total_frames=320").train()
    level, saved = numbers(tmp_path, "curriculum/level"), numbers(tmp_path, "curriculum/saved_0")
    chances = [numbers(tmp_path, f"curriculum/chance_{each}") for each in range(3)]
    assert [each[0] for each in chances] == [0.75, 0.0, 0.25] and level[0] == 0.25 * 2
    assert [each[-1] for each in chances] == [0.0, 0.0, 1.0] and level[-1] == 2.0
    assert level == sorted(level) and 0.75 * 1 + 0.25 * 2 in level
    assert saved[0] is None and 0.02 < saved[-1] <= 1.0
    judged = next(at for at, each in enumerate(saved) if each is not None)
    assert level[judged] == 0.5 and level[judged + 1] == 1.25, "a row has the chances by which its batch was drawn"
    assert all(sum(each) == pytest.approx(1.0) for each in zip(*chances, strict=True))


def test_a_run_without_a_curriculum_has_neither_columns_nor_state(tmp_path):
    training = tiny(tmp_path, "total_frames=32")
    training.train()
    assert not [name for name in rows(tmp_path)[0] if name.startswith("curriculum/")]
    assert "curriculum" not in training.state_dict() and training.level_sampler is None


def test_the_last_share_of_a_training_is_of_the_target_alone(tmp_path):
    training = tiny(tmp_path, *CLIMBS, "curriculum.high=1.0", "curriculum.until=0.5", "curriculum.floor=0.0")
    found = []
    for [batch] in training.batches():
        starts = batch["info", "episode_length"][..., 0] == 0.0
        found.append((training.frames, set(batch["info", "level"][..., 0][starts].tolist())))
        training._learn([batch])
        if training.frames >= 192:
            break
    # 192 frames: 96 is the half; a world that ended with the last step of a batch has started by what held before
    assert found[0][1] == {0} and all(levels <= {0, 2} for _, levels in found)
    assert all(levels <= {2} for frames, levels in found if frames >= 128) and found[-1][1] | found[-2][1] == {2}


def test_a_floor_of_episodes_is_of_the_target_from_the_start(tmp_path):
    training = tiny(tmp_path, *CLIMBS, "n_worlds=64", "curriculum.floor=0.5")
    counts = training.env.level.bincount(minlength=3).tolist()
    assert counts[1] == 0 and 20 < counts[2] < 44


def test_evaluation_plays_the_scenario_whatever_is_learned(tmp_path):
    overrides = ["evaluation.interval=64", "total_frames=64", "evaluation.mode=sampled"]
    (tmp_path / "with").mkdir()
    easy = ["curriculum=success", "curriculum.over.ignition.count=[1,2]", "curriculum.floor=0"]
    training = tiny(tmp_path / "with", *overrides, *easy)
    training.train()
    (tmp_path / "without").mkdir()
    plain = tiny(tmp_path / "without", *overrides)
    plain.learner.loss.load_state_dict(training.learner.loss.state_dict())
    plain.frames = plain.last_batch = 64
    row = {}
    EvaluationsOnTheWay(plain.run_config).on_batch(plain, row)
    assert numbers(tmp_path / "with", "evaluation/saved")[-1] == row["evaluation/saved"]
    assert plain.env.world == training.run_config.make_env(1, 0).world


def test_a_baseline_plays_each_level_once_and_is_kept(tmp_path):
    overrides = ["curriculum=regret", "curriculum.over.steps_per_tick=[30,1]", "curriculum.worlds=8", "total_frames=32"]
    training = tiny(tmp_path, *overrides, "curriculum.floor=0")
    easy, target = training.level_sampler.state.baseline
    assert easy > target + 0.02, "the fire of level 0 is seven times slower"
    total = easy + target  # nothing is known of the team
    assert training.level_sampler.chances == pytest.approx((easy / total, target / total))
    training.train()
    assert newest(tmp_path)[0].training()["curriculum"]["baseline"] == [easy, target]


def test_a_replay_memory_holds_all_levels(tmp_path):
    replay = ["algorithm=dqn", *REPLAY, "algorithm.warm_up=16", "total_frames=96", "curriculum.floor=0.5"]
    training = tiny(tmp_path, *CLIMBS, *replay)
    training.train()
    assert len(rows(tmp_path)) == 3 and rows(tmp_path)[-1]["train/loss"] != ""
    assert len(set(training.env.level.tolist())) > 1


def test_worlds_draw_the_same_levels_however_many_processes_there_are(tmp_path):
    whole = tiny(tmp_path, *CLIMBS, "n_worlds=8", "curriculum.floor=0.5").env
    half = tiny(tmp_path, *CLIMBS, "n_worlds=4", "curriculum.floor=0.5").run_config.make_training_env(4, 4)
    half.draw_by((0.5, 0.0, 0.5))
    half.reset()
    assert torch.equal(half.level, whole.level[4:])
