"""A policy's history: every training behind it counts once, whoever saved, resumed, averaged or exported it."""

import json
from dataclasses import asdict, replace

import pytest

from tests.forgery import forge
from tests.training.test_loop import TINY, tiny
from warp_torchrl import train
from warp_torchrl.commands.export import main
from warp_torchrl.evaluation.reading import read_evaluation
from warp_torchrl.runs.checkpoint import CheckpointError, newest
from warp_torchrl.runs.history import (
    MEAN,
    UNKNOWN,
    Stage,
    Teacher,
    history_from_plain,
    history_line,
    history_to_plain,
    joined,
    mean_of,
    stage_of,
    teacher_names,
    trained_minutes,
    trained_steps,
)


def stage(key, steps, *parents, teachers=()):
    return Stage(key=key, steps=steps, worlds="ring", algorithm="mappo", parents=parents, teachers=teachers)


def test_a_mean_counts_what_its_policies_share_once():
    first, second, third = stage("a", 100), stage("b", 30, "a"), stage("c", 5, "b")
    mean = mean_of([(first, second, third), (first, second)])
    assert [each.steps for each in mean] == [100, 30, 5, 0] and trained_steps(mean) == 135
    assert mean[-1].algorithm == MEAN and mean[-1].parents == ("c", "b")
    assert history_line(mean) == "135 world steps in 3 trainings"


def test_minutes_are_summed_where_each_training_took_them():
    first, second = replace(stage("a", 100), minutes=1.5), replace(stage("b", 30, "a"), minutes=2.0)
    assert trained_minutes((first, second)) == 3.5 == trained_minutes(mean_of([(first, second)]))
    assert trained_minutes((first, stage("b", 30, "a"))) is None
    kept = json.loads(json.dumps(history_to_plain((first, second))))
    assert history_from_plain(kept) == (first, second)


@pytest.mark.parametrize("minutes", ["1", True, -1.0, float("nan"), float("inf"), 7])
def test_minutes_that_are_no_number_are_refused(minutes):
    content = [asdict(stage("a", 1)) | {"teachers": [], "parents": [], "minutes": minutes}]
    with pytest.raises(ValueError, match="minutes must be a number"):
        history_from_plain(content)


def test_two_checkpoints_of_one_training_are_one_training():
    found = joined([(stage("a", 64),), (stage("a", 192),), (stage("a", 128),)])
    assert [each.steps for each in found] == [192]


def test_a_training_is_the_same_with_another_total_and_another_with_another_seed():
    values = {"seed": 0, "total_frames": 64, "start_from": "runs/1", "observation": {"advice": "dispatch"}}
    first, longer, other = (
        stage_of({"algorithm": "mappo"}, values | change, "ring", (), ())
        for change in ({}, {"total_frames": 128}, {"seed": 1})
    )
    assert first == longer and first.key != other.key
    assert first.parents == (UNKNOWN,) and first.adviser == "dispatch"
    assert stage_of({}, values, "ring", (first,), ()).parents == (first.key,)


def test_teachers_are_those_of_kinds_and_people_too():
    imitation = {"teacher": "local", "guide": None, "demonstrations": "recordings"}
    kinds = {"single": {"teacher": "single"}, "ring": {}, "water": {"teacher": "local"}}
    assert teacher_names({"imitation": imitation, "mixture": {"kinds": kinds}}) == ["local", "single", "people"]
    assert teacher_names({}) == []


def test_a_manifest_keeps_a_history_as_it_is():
    history = (stage("a", 7, teachers=(Teacher(name="local"), Teacher(name="mine", steps=3))), stage("b", 2, "a"))
    assert history_from_plain(json.loads(json.dumps(history_to_plain(history)))) == history


@pytest.mark.parametrize("change", [{"steps": -1}, {"worlds": "a\nb"}, {"parents": ["?"]}, {"key": "b"}, {"more": 1}])
def test_a_history_of_a_stranger_is_checked(change):
    plain = history_to_plain((stage("a", 7), stage("b", 2, "a")))
    with pytest.raises((ValueError, TypeError)):
        history_from_plain([plain[0] | change, plain[1]])


def test_a_run_that_starts_from_another_goes_on_with_its_history(tmp_path, capsys):
    for name in ("first", "second"):
        (tmp_path / name).mkdir()
    tiny(tmp_path / "first", "total_frames=64", "imitation.teacher=local").train()
    second = tiny(tmp_path / "second", "total_frames=64")
    second.start_from(newest(tmp_path / "first")[0])
    second.train()
    main([str(tmp_path / "second"), str(tmp_path / "mean"), "--average", str(tmp_path / "first")])
    first, own, mean = (newest(tmp_path / name)[0].history for name in ("first", "second", "mean"))
    assert [each.steps for each in own] == [64, 64] and own[0] == first[0] and own[1].parents == (first[0].key,)
    assert first[0].teachers == (Teacher(name="local"),) and mean[:-1] == own and trained_steps(mean) == 128
    assert "128 world steps in 2 trainings; taught by local" in capsys.readouterr().out


@pytest.mark.slow
def test_a_run_that_is_resumed_keeps_the_history_that_it_began_with(tmp_path):
    given = [*TINY, "total_frames=64", "evaluation.baselines=[noop]"]
    train(given, folder=tmp_path / "first")
    train([*given, f"start_from={tmp_path / 'first'}"], folder=tmp_path / "second")
    before = newest(tmp_path / "second")[0].history
    result = train([f"resume={tmp_path / 'second'}", "total_frames=96"]).result
    after = newest(tmp_path / "second")[0].history
    assert [each.steps for each in before] == [64, 64] and [each.steps for each in after] == [64, 96]
    assert [each.key for each in before] == [each.key for each in after]
    assert str(result).splitlines()[-1] == "trained: 160 world steps in 2 trainings"
    assert read_evaluation(tmp_path / "second" / "evaluation.json")["frames"] == 96


def test_a_checkpoint_without_a_history_tells_what_its_configuration_says(tmp_path):
    tiny(tmp_path, "total_frames=64", "imitation.teacher=local").train()
    found = newest(tmp_path)[0]
    content = json.loads((found.path / "manifest.json").read_text())
    forge(found.path, history=[])
    own = tuple(replace(stage, minutes=None) for stage in found.history)
    assert newest(tmp_path)[0].history == own and content["history"]
    forge(found.path, history=[{"key": "a"}])
    with pytest.raises(CheckpointError, match=r"manifest.json is not a manifest of format 2"):
        newest(tmp_path)
