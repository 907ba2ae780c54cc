"""The loop of a search, with trainings that take no time."""

import json
import time

import pytest

optuna = pytest.importorskip("optuna", reason="needs the extra search")

from optuna.trial import TrialState

from tests.commands.hyperparameters.training import TOTAL, Quick
from tests.runs.test_checkpoint import saved
from warp_torchrl.commands.hyperparameters.search import Search, best_of, wait_until_free
from warp_torchrl.commands.hyperparameters.storage import JOURNAL, open_study
from warp_torchrl.runs import process
from warp_torchrl.runs.checkpoint import newest
from warp_torchrl.runs.config.construction import ConfigError
from warp_torchrl.runs.config.options import SearchOptions
from warp_torchrl.runs.config.space import dimension
from warp_torchrl.runs.process import SearchEnded
from warp_torchrl.system.lock import RunFolderInUse, RunFolderLock

SPACE = [dimension("x=interval(0, 1)"), dimension("n=int(interval(1, 9))"), dimension("kind=good,bad")]


def searched(folder, *given, **options):
    """A search whose trainings save x; ``given`` are values of x that its first trials have."""
    options = SearchOptions(**{"trials": 5, "startup": 2, **options})
    folder.mkdir(exist_ok=True)
    study = open_study(folder, options)
    for x in given:
        study.enqueue_trial({"x": x, "n": 3, "kind": "good"})

    def start(values, seed, place):
        return Quick(values["x"] + 0.1 * seed, place)

    return Search(
        study=study, space=SPACE, options=options, folder=folder, start=start, total=lambda _: TOTAL, seconds=0.0
    )


def states(search):
    return [each.state.name for each in search.study.trials]


def test_a_trial_is_worth_its_evaluation_or_the_last_fifth_of_its_training(tmp_path):
    search = searched(tmp_path / "a", 0.5, trials=1)
    search.run()
    assert search.study.trials[0].value == pytest.approx(0.51)
    search = searched(tmp_path / "b", 0.5, trials=1, objective="training")
    search.run()
    assert search.study.trials[0].value == pytest.approx(0.5 * (0.9 + 1.0) / 2)
    assert search.study.trials[0].intermediate_values[40] == pytest.approx(0.5 * 0.4)


def test_a_trial_is_the_mean_of_its_seeds(tmp_path):
    search = searched(tmp_path, 0.5, trials=1, seeds=3)
    search.run()
    (trial,) = search.study.trials
    assert trial.value == pytest.approx(0.61) and trial.user_attrs["values"] == pytest.approx([0.51, 0.61, 0.71])
    assert trial.intermediate_values[100] == pytest.approx(0.6)
    assert sorted(path.name for path in (tmp_path / "trials" / "0").iterdir()) == ["seed_0", "seed_1", "seed_2"]


def test_a_trial_below_the_median_at_equal_frames_is_stopped_and_no_better_one_is(tmp_path):
    search = searched(tmp_path, 0.5, 0.6, 0.7, 0.1, 0.8, trials=5, startup=3, prune_from=0.4)
    search.run()
    assert states(search) == ["COMPLETE"] * 3 + ["PRUNED", "COMPLETE"]
    pruned = search.study.trials[3]
    assert max(pruned.intermediate_values) == 40 and pruned.value == pytest.approx(0.1 * 0.4)
    assert Quick(0.1, tmp_path / "trials" / "3").done < 10
    assert best_of(search.study).number == 4


def test_a_trial_that_has_ended_reports_all_of_its_training_however_bad(tmp_path):
    search = searched(tmp_path, 0.5, 0.6, 0.7, 0.1, trials=4, startup=3, prune_from=0.4)

    class AtOnce(Quick):
        def poll(self):
            while (code := super().poll()) is None:
                pass
            return code

    start = search.start
    search.start = lambda values, seed, place: AtOnce(0.1, place) if place.name == "3" else start(values, seed, place)
    search.run()
    assert states(search) == ["COMPLETE"] * 4
    assert max(search.study.trials[3].intermediate_values) == 100


def test_without_a_pruner_all_are_trained(tmp_path):
    search = searched(tmp_path, 0.5, 0.6, 0.7, 0.1, trials=4, pruner="none")
    search.run()
    assert states(search) == ["COMPLETE"] * 4


def test_hyperband_ends_some(tmp_path):
    search = searched(tmp_path, *(0.9 - 0.02 * place for place in range(12)), trials=12, pruner="hyperband")
    search.run()
    assert 0 < states(search).count("PRUNED") < 12


def test_jobs_train_side_by_side_and_no_more_of_them(tmp_path):
    search, most = searched(tmp_path, jobs=3, pruner="none"), []
    look = search._look
    search._look = lambda: (most.append(len(search._running)), look())
    search.run()
    assert max(most) == 3 and states(search) == ["COMPLETE"] * 5


def test_a_trial_that_ends_before_an_earlier_one_is_told_at_once(tmp_path):
    search, told = searched(tmp_path, trials=2, jobs=2, pruner="none"), []
    start = search.start

    def begin(values, seed, place):
        training = start(values, seed, place)
        training.until = 20 if place.name == "0" else 10
        return training

    search.start, search.after = begin, lambda: told.append(states(search))
    search.run()
    assert told == [["RUNNING", "COMPLETE"], ["COMPLETE", "COMPLETE"]]


def test_a_search_that_was_stopped_goes_on_as_one_that_was_not(tmp_path):
    whole = searched(tmp_path / "whole")
    whole.run()
    looks = []
    first = searched(tmp_path / "parts")
    first.received = lambda: looks.append(0) or (2 if len(looks) > 26 else 0)
    with pytest.raises(SearchEnded, match=r"stopped by signal SIGINT; .*search\.out=.*parts goes on") as ended:
        first.run()
    assert ended.value.code == 130 and states(first) == ["COMPLETE"] * 2 + ["RUNNING"]
    assert 0 < Quick(0.0, tmp_path / "parts" / "trials" / "2").done < 10
    second = searched(tmp_path / "parts")
    second.run()
    assert [each.params for each in second.study.trials] == [each.params for each in whole.study.trials]
    assert [each.values for each in second.study.trials] == [each.values for each in whole.study.trials]
    assert [each.intermediate_values for each in second.study.trials] == [
        each.intermediate_values for each in whole.study.trials
    ]


def test_a_finished_search_does_nothing_and_more_trials_make_it_longer(tmp_path):
    searched(tmp_path, trials=2).run()
    again = searched(tmp_path, trials=2)
    again.start = None
    again.run()
    assert states(again) == ["COMPLETE"] * 2
    longer = searched(tmp_path, trials=3)
    longer.run()
    assert states(longer) == ["COMPLETE"] * 3


def test_a_kill_that_cut_the_journal_and_left_its_lock_loses_no_trial(tmp_path):
    first = searched(tmp_path)
    first.run()
    journal = tmp_path / JOURNAL
    lines = journal.read_bytes().splitlines(keepends=True)
    begun = next(place for place, line in enumerate(lines) if b'"param_name"' in line and b'"trial_id":4' in line)
    journal.write_bytes(b"".join(lines[: begun + 1]) + lines[begun + 1][:9])  # trial 4 had drawn one value of three
    (tmp_path / f"{JOURNAL}.lock").symlink_to(journal)
    before = time.monotonic()
    again = searched(tmp_path)
    assert time.monotonic() - before < 20.0, "Optuna itself waits half a minute for such a lock"
    assert states(again) == [*states(first)[:4], "RUNNING"]
    again.run()
    assert [each.params for each in again.study.trials[:4]] == [each.params for each in first.study.trials[:4]]
    assert again.study.trials[4].params["x"] == first.study.trials[4].params["x"]
    assert len(again.study.trials) == 5 and "RUNNING" not in states(again)


@pytest.mark.parametrize(
    "line", [b"not json\n", b'{"op_code": 4}\n', b'{"op_code": 77, "worker_id": "a"}\n', b"[]\n", b"\xff\n"]
)
def test_a_broken_journal_is_told_in_one_line_and_left_as_it_is(tmp_path, line):
    searched(tmp_path, trials=1).run()
    journal = tmp_path / JOURNAL
    lines = journal.read_bytes().splitlines(keepends=True)
    broken = b"".join([*lines[:3], line, *lines[3:]])
    journal.write_bytes(broken)
    with pytest.raises(ConfigError, match=rf"search\.out: .*{JOURNAL} cannot be read, \w+.*; take another folder"):
        searched(tmp_path)
    assert journal.read_bytes() == broken


def failing(search, *codes):
    """Let the first trainings of a search end with these codes, half way."""
    start, left = search.start, list(codes)

    def begin(values, seed, place):
        training = start(values, seed, place)
        if left:
            training.code, training.until = left.pop(0), 5
        return training

    search.start = begin
    return search


def test_failed_trials_are_named_and_do_not_count_and_three_end_the_search(tmp_path):
    search = failing(searched(tmp_path / "a", trials=2), 1, 143)
    search.run()
    assert states(search) == ["FAIL", "FAIL", "COMPLETE", "COMPLETE"]
    assert [each.user_attrs["reason"] for each in search.failed] == [
        "ended with 1",
        "a signal from elsewhere stopped its training",
    ]
    with pytest.raises(SearchEnded, match="3 trials failed, the last one because: ended with 2") as ended:
        failing(searched(tmp_path / "b"), 1, 1, 2).run()
    assert ended.value.code == 2


def test_a_training_that_is_not_finite_counts_and_is_no_failure(tmp_path):
    search = failing(searched(tmp_path, trials=2), 5)
    search.run()
    assert states(search) == ["PRUNED", "COMPLETE"] and not search.failed
    assert search.study.trials[0].user_attrs["reason"] == "ended with 5"


def test_a_full_disk_ends_the_search_and_the_trial_goes_on_with_the_next(tmp_path):
    search = failing(searched(tmp_path, trials=2), 6)
    with pytest.raises(SearchEnded, match=r"ended with 6; .* goes on") as ended:
        search.run()
    assert ended.value.code == 6 and states(search) == ["RUNNING"]
    again = searched(tmp_path, trials=2)
    again.run()
    assert states(again) == ["COMPLETE"] * 2


def test_one_seed_that_fails_stops_the_others_of_its_trial(tmp_path):
    search = failing(searched(tmp_path, trials=1, seeds=2), 1)
    search.run()
    assert states(search) == ["FAIL", "COMPLETE"]
    assert Quick(0.0, tmp_path / "trials" / "0" / "seed_1").done < 10


def test_a_training_that_reports_nothing_at_its_end_has_failed(tmp_path):
    search = searched(tmp_path, trials=1)

    class Silent(Quick):
        def poll(self):
            code = super().poll()
            (self.folder / "evaluation.json").unlink(missing_ok=True)
            return code

    search.start = lambda values, seed, place: Silent(0.5, place)
    with pytest.raises(SearchEnded, match=r"3 trials failed, the last one because: .* has no evaluation"):
        search.run()


def test_whatever_ends_a_search_ends_its_trainings(tmp_path):
    search, started = searched(tmp_path, jobs=2), []
    start = search.start

    def begin(values, seed, place):
        if started:
            raise OSError("no more processes")
        started.append(start(values, seed, place))
        return started[-1]

    search.start = begin
    with pytest.raises(OSError, match="no more processes"):
        search.run()
    assert started[0].is_stopped


@pytest.mark.parametrize("keep", [True, False])
def test_the_policies_alone_are_kept_of_trials_that_have_ended(tmp_path, keep):
    search = searched(tmp_path, 0.5, 0.6, 0.1, trials=3, keep_training=keep, startup=2)
    start = search.start

    def begin(values, seed, place):
        saved(place, 100)
        return start(values, seed, place)

    search.start = begin
    search.run()
    assert states(search) == ["COMPLETE", "COMPLETE", "PRUNED"]
    found = [newest(tmp_path / "trials" / str(number))[0] for number in range(3)]
    assert ["training.pt" in each.manifest.files for each in found] == [keep] * 3


@pytest.mark.parametrize(("does", "code"), [("kill -9 $$", 128 + 9), ("exit 3", 3)])
def test_a_training_that_a_signal_killed_has_the_exit_code_of_a_shell(tmp_path, monkeypatch, does, code):
    line = ["sh", "-c", f"echo 'error: no room' >&2; {does}"]
    monkeypatch.setattr(process, "command", lambda *given: line)
    training = process.TrainingProcess([], tmp_path / "run", threads=None)
    training._process.wait(10)
    assert training.poll() == code and training.reason() == "no room"


def test_a_folder_into_which_another_process_trains_is_waited_for(tmp_path):
    lock = RunFolderLock(tmp_path)
    with pytest.raises(RunFolderInUse):
        wait_until_free(tmp_path, seconds=0.0)
    lock.release()
    wait_until_free(tmp_path, seconds=0.0)


def test_nothing_but_lines_of_json_is_stored(tmp_path):
    searched(tmp_path, trials=2).run()
    assert all(isinstance(json.loads(line), dict) for line in (tmp_path / JOURNAL).read_text().splitlines())
    assert sorted(path.name for path in tmp_path.iterdir()) == [JOURNAL, "trials"]
    assert TrialState.RUNNING not in {each.state for each in searched(tmp_path).study.trials}
