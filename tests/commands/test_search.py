"""The command search: its mistakes in one line, its folder, and once a real search."""

import json
import os
import signal
import subprocess
import sys
import time

import pytest
import yaml

from tests.commands.hyperparameters.training import TOTAL, Quick
from tests.commands.test_command import TINY
from warp_torchrl.commands import search as search_module
from warp_torchrl.commands.failure import DISK, DONE, IN_USE, MISTAKE
from warp_torchrl.commands.search import FIRES, check_points, main
from warp_torchrl.runs.config.compose import compose_config, conf_folder
from warp_torchrl.runs.config.plain_values import plain
from warp_torchrl.runs.config.space import divided
from warp_torchrl.system.lock import RunFolderLock

optuna = pytest.importorskip("optuna", reason="needs the extra search")

RATE = "algorithm.learning_rate=tag(log, interval(1e-4, 3e-3))"
BRIEF = [RATE, f"total_frames={TOTAL}", "search.trials=2", "search.startup=2"]


@pytest.fixture
def searched(tmp_path, monkeypatch, capsys):
    """Search in a folder of its own with trainings that take no time; returns exit code, stderr's lines and stdout."""
    monkeypatch.chdir(tmp_path)
    searched.started = []

    def start(overrides, folder, threads):
        searched.started.append((overrides, threads))
        return Quick(0.5, folder)

    monkeypatch.setattr(search_module, "TrainingProcess", start)
    monkeypatch.setattr(search_module, "_draw", lambda *search: None)  # takes longer than all the rest
    monkeypatch.setattr(search_module, "_SECONDS_BETWEEN_LOOKS", 0.0)

    def run(*arguments):
        code = main(arguments)
        said = capsys.readouterr()
        return code, said.err.splitlines(), said.out

    run.started = searched.started
    return run


@pytest.mark.parametrize(
    ("arguments", "line"),
    [
        (
            ["algorithm.learnin_rate=interval(0, 1)"],
            "algorithm.learnin_rate is not a key of the configuration: did you",
        ),
        (
            [RATE, "algorithm.gama=0.9"],
            "algorithm.gama is not a key of the configuration: did you mean algorithm.gamma?",
        ),
        (["model.activation=tanh,rlu"], "model.activation must be tanh or relu, got 'rlu': did you mean relu?"),
        (["algorithm.learning_rate=interval(-1, 1)"], "algorithm.learning_rate must be"),
        (
            ["algorithm=ppo,dqn", "algorithm.epochs=range(1, 4)"],
            "algorithm.epochs is not a key of the configuration, but",
        ),
        (["processes=1,3", "n_worlds=3,4", "algorithm.minibatch_size=16"], "processes must divide n_worlds, 4, got 3"),
        (["algorithm.gamma=interval(0.9"], "algorithm.gamma=interval(0.9 cannot be read"),
        ([], "nothing is searched: name a ready search, search=NAME of a2c, ddpg, dqn, ppo, sac, or give"),
        (["search=pp"], "search must be one of a2c, ddpg, dqn, ppo, sac, got pp: did you mean ppo?"),
        (
            ["search=ppo", "search.trails=3"],
            "search.trails is not a key of the configuration: did you mean search.trials?",
        ),
        ([RATE, "search.jobs=0"], "search.jobs must be in [1, 1000], got 0"),
        ([RATE, "search.pruner=medan"], "search.pruner must be median or hyperband or none, got 'medan': did you mean"),
        (["seed=0,1,2"], "seed cannot be searched, got 0,1,2; search.seeds=N trains each trial with N"),
        (["resume=a,b"], "resume cannot be searched, got a,b"),
        ([RATE, "hydra.run.dir=x"], "hydra.run.dir=x must be left out"),
        ([RATE, "resume=x"], "resume=x must be left out"),
        ([RATE, "-m"], "-m must be left out: a search takes keys alone"),
        ([RATE, "--trials", "3"], "keys are given as trials=3, without dashes"),
    ],
)
def test_a_mistake_is_told_in_one_line_before_any_trial(searched, tmp_path, arguments, line):
    code, errors, _ = searched(*arguments)
    assert code == MISTAKE and errors[-1].startswith(f"error: {line}"), errors
    assert not searched.started and not list(tmp_path.iterdir())


def test_an_unknown_key_is_told_without_the_values_of_others(searched):
    _, errors, _ = searched(RATE, "algorithm.gama=interval(0.9, 1.0)")
    assert errors[-1].endswith("did you mean algorithm.gamma?")


def test_without_optuna_it_says_what_to_install(searched, tmp_path, monkeypatch):
    find = search_module.find_spec
    monkeypatch.setattr(search_module, "find_spec", lambda name: None if name == "optuna" else find(name))
    code, errors, _ = searched(*BRIEF)
    assert code == MISTAKE
    assert errors == ['error: a search needs optuna, which is missing: pip install "warp_torchrl[search]"']


def test_the_first_trial_is_the_configuration_as_it_is_and_all_are_runs_of_their_own(searched, tmp_path, monkeypatch):
    monkeypatch.delenv("OMP_NUM_THREADS")
    monkeypatch.setattr(search_module.torch, "get_num_threads", lambda: 8)
    code, _, page = searched(
        *BRIEF, "scenario=single", "seed=3", "search.seeds=2", "search.jobs=2", 'search.out="it\'s"'
    )
    assert code == DONE and "| 0, as it is | trained | 51.0 | 51.0 .. 51.0 | 0.001 |" in page
    overrides, threads = searched.started[0]
    assert threads == 2, "of 8, for two trials of two seeds"
    assert "algorithm.learning_rate=0.001" in overrides and f"evaluation.first_seed={FIRES}" in overrides
    places = [
        [each for each in overrides if each.startswith(("seed", "hydra.run"))] for overrides, _ in searched.started
    ]
    assert places[:2] == [[f"seed={3 + n}", f"hydra.run.dir='it\\'s/trials/0/seed_{n}'"] for n in (0, 1)]
    plain(compose_config("train", [each for each in overrides if not each.startswith("hydra")]))
    best = yaml.safe_load((tmp_path / "it's" / "experiment" / "best.yaml").read_text())
    assert best["total_frames"] == TOTAL and best["defaults"] == [{"override /scenario": "single"}, "_self_"]
    assert best["algorithm"]["learning_rate"] == pytest.approx(0.001), "written though it is the default"


def test_the_same_command_goes_on_and_another_one_is_refused(searched, tmp_path):
    assert searched(*BRIEF, "search.out=x")[0] == DONE
    before = (tmp_path / "x" / "journal.log").read_bytes()
    assert searched(*BRIEF, "search.out=x")[0] == DONE and len(searched.started) == 2
    assert (
        searched(*BRIEF, "search.trials=3", "search.jobs=2", "search.out=x")[0] == DONE and len(searched.started) == 3
    )
    assert (tmp_path / "x" / "journal.log").read_bytes().startswith(before)
    others = {
        "algorithm.gamma=interval(0.9, 0.99)": "algorithm.gamma was not searched, and is interval(0.9, 0.99)",
        "algorithm.learning_rate=interval(1e-4, 3e-3)": "algorithm.learning_rate was tag(log, interval(1e-4, 3e-3)),",
        "algorithm.gamma=0.5": "reward.gamma was 0.99, and is 0.5",
    }
    for override, line in others.items():
        given = [each for each in BRIEF if each.partition("=")[0] != override.partition("=")[0]]
        code, errors, _ = searched(*given, override, "search.out=x")
        assert (
            code == MISTAKE
            and line in errors[-1]
            and errors[-1].startswith("error: search.out: x holds another search")
        )
    assert len(searched.started) == 3


def test_a_folder_that_holds_anything_else_is_refused(searched, tmp_path):
    (tmp_path / "x").mkdir()
    (tmp_path / "x" / "thesis.tex").touch()
    code, errors, _ = searched(*BRIEF, "search.out=x")
    assert code == MISTAKE and errors[-1].startswith("error: search.out: x holds thesis.tex; take another folder")
    (tmp_path / "x" / "search.json").write_text("{}")
    code, errors, _ = searched(*BRIEF, "search.out=x")
    assert code == MISTAKE and errors[-1].endswith("x/search.json is not the record of a search; take another folder")


def test_two_searches_do_not_share_a_folder(searched, tmp_path):
    searched(*BRIEF, "search.out=x")
    lock = RunFolderLock(tmp_path / "x")
    code, errors, _ = searched(*BRIEF, "search.trials=5", "search.out=x")
    lock.release()
    assert code == IN_USE and len(searched.started) == 2 and errors[-1].startswith("error: x is in use")


def test_a_broken_journal_is_told_in_one_line(searched, tmp_path):
    searched(*BRIEF, "search.out=x")
    (tmp_path / "x" / "journal.log").write_text("no\nno\n")
    code, errors, _ = searched(*BRIEF, "search.out=x")
    assert code == MISTAKE and errors[-1].startswith("error: search.out: x/journal.log cannot be read")


@pytest.mark.stress
def test_failed_trials_are_named_and_a_full_disk_has_its_exit_code(searched, monkeypatch):
    codes = [1]
    monkeypatch.setattr(
        search_module,
        "TrainingProcess",
        lambda overrides, folder, threads: Quick(0.5, folder, codes.pop() if codes else 0, until=10),
    )
    code, errors, _ = searched(*BRIEF, "search.out=x")
    assert code == 1 and errors[-1] == "error: trial 0 failed: ended with 1"
    codes.append(DISK)
    code, errors, page = searched(*BRIEF, "search.out=y")
    assert code == DISK and errors[-1].startswith("error: ended with 6; the same command with search.out=y goes on")
    assert "| 0, as it is | training |" in page


READY = sorted(path.stem for path in (conf_folder() / "search").glob("*.yaml"))


@pytest.mark.slow
@pytest.mark.parametrize("ready", READY)
def test_every_ready_search_is_of_values_that_trainings_take(ready):
    options = plain(compose_config("search", [f"search={ready}"]))["search"]
    space, fixed = divided(["scenario=skirmish"], options["space"], options["fixed"])
    base = check_points(space, fixed)
    for each in space:  # so that the first trial is the configuration as it is
        value = base
        for part in each.key.split("."):
            value = value[part]
        assert each.holding(value) is not None, each.key


def test_the_ready_searches_are_of_the_learners_that_their_names_say():
    assert READY == ["a2c", "ddpg", "dqn", "ppo", "sac"]
    for ready in READY:
        options = plain(compose_config("search", [f"search={ready}"]))["search"]
        known = plain(compose_config("train", options["fixed"]))["algorithm"]
        assert options["fixed"] == [f"algorithm={ready}"]
        assert {key.removeprefix("algorithm.") for key in options["space"]} <= set(known)


# A real one


def begin(folder, *arguments):
    return subprocess.Popen(
        [sys.executable, "-m", "warp_torchrl", "search", *TINY, RATE, "search.trials=2", "search.out=x", *arguments],
        cwd=folder,
        env={**os.environ, "OMP_NUM_THREADS": "1"},
        stdout=subprocess.PIPE,
        stderr=subprocess.PIPE,
        text=True,
        start_new_session=True,
    )


def wait_for(condition, seconds=120.0):
    until = time.monotonic() + seconds
    while not condition():
        assert time.monotonic() < until
        time.sleep(0.05)


@pytest.mark.slow
def test_a_search_that_was_killed_and_one_that_was_stopped_go_on_with_their_trials(tmp_path):
    metrics, long = tmp_path / "x" / "trials" / "0" / "metrics.csv", "total_frames=1_600"
    killed = begin(tmp_path, long)
    wait_for(lambda: metrics.exists() and metrics.read_text().count("\n") > 3)
    killed.send_signal(signal.SIGKILL)
    killed.communicate()
    stopped = begin(tmp_path, long)  # waits until the training of the killed one, which sees its end, has saved
    wait_for(lambda: "resumed" in "".join(path.read_text() for path in metrics.parent.glob("*.log")))
    stopped.send_signal(signal.SIGINT)
    _, errors = stopped.communicate(timeout=120)
    assert stopped.returncode == 130
    assert errors.splitlines()[-1] == "error: stopped by signal SIGINT; the same command with search.out=x goes on"
    last = begin(tmp_path, long)
    page, errors = last.communicate(timeout=240)
    assert last.returncode == DONE, errors
    assert page.count("| trained |") == 2 and "| 0, as it is | trained |" in page
    frames = [int(line.split(",")[0]) for line in metrics.read_text().splitlines()[1:]]
    assert frames == [32 * n for n in range(1, 51)], "no row twice, and none lost"
    assert json.loads((metrics.parent / "evaluation.json").read_text())["seeds"][0] == FIRES
