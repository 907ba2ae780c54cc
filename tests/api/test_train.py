"""Trainings from Python: callbacks, the run that they return, and errors that come back as such."""

import json
import logging
import signal

import numpy as np
import pytest

from warp_torchrl import Array, evaluate, train
from warp_torchrl.runs.checkpoint import newest
from warp_torchrl.runs.config.construction import ConfigError

TINY = [
    "landscape.size=12",
    "horizon=8",
    "n_worlds=4",
    "collector.steps=8",
    "collector.grows_at=0",
    "total_frames=64",
    "checkpoint.interval=32",
    "checkpoint.minutes=0",
    "evaluation.episodes=2",
    "evaluation.baselines=[noop]",
    "evaluation.mode=sampled",
    "algorithm.minibatch_size=16",
    "model.actor_hidden=[8]",
    "model.critic_hidden=[8]",
]


class Noting:
    """Notes what is called, and adds a column."""

    def __init__(self):
        self.calls, self.rows = [], []

    def on_batch(self, training, row):
        self.calls.append(("batch", training.frames))
        self.rows.append(dict(row))
        row["mine/frames"] = 2.0 * training.frames

    def on_evaluation(self, training, result):
        self.calls.append(("evaluation", training.frames, result.folder is not None))

    def on_checkpoint(self, training, folder):
        self.calls.append(("checkpoint", training.frames, folder.name))

    def on_end(self, training):
        self.calls.append(("end", training.frames))


@pytest.fixture(scope="module")
def trained(tmp_path_factory):
    noting, before = Noting(), signal.getsignal(signal.SIGINT)
    noting.handlers = []

    class Handlers:
        def on_batch(self, training, row):
            noting.handlers.append(signal.getsignal(signal.SIGINT) is before)

    folder = tmp_path_factory.mktemp("api") / "run"
    run = train([*TINY, "evaluation.interval=64"], team=dict(n_agents=3), callbacks=[noting, Handlers()], folder=folder)
    return run, noting


def test_hooks_are_called_as_the_training_goes(trained):
    _, noting = trained
    assert noting.calls == [
        ("batch", 32),
        ("checkpoint", 32, "32"),
        ("evaluation", 64, False),
        ("batch", 64),
        ("checkpoint", 64, "64"),
        ("evaluation", 64, True),
        ("end", 64),
    ]
    assert [row["evaluation/saved"] is None for row in noting.rows] == [True, False]


def test_signals_are_left_to_the_caller(trained):
    assert trained[1].handlers == [True, True]


def test_a_run_says_what_was_trained(trained):
    run, noting = trained
    metrics = run.metrics()
    assert metrics["mine/frames"].tolist() == [64.0, 128.0], "a column of the callback"
    assert metrics["evaluation/saved"][1] == noting.rows[1]["evaluation/saved"]
    assert run.frames == 64 and run.policy().mode == "sampled"
    written = json.loads((run.folder / "evaluation.json").read_text())
    assert run.result.report == written and written["scenario"] == "skirmish"
    assert run.result.mean() == pytest.approx(written["metrics"]["saved"]["mean"])
    assert "trained, sampled - noop" in str(run.result) and run.result.picture.name == "episode.gif"
    assert newest(run.folder)[0].saved_config().values["team"]["n_agents"] == 3


def test_rows_have_what_agents_and_roles_did(trained):
    row = trained[1].rows[0]
    rewards = [row[f"agents/reward_bulldozer_{agent}"] for agent in range(3)]
    assert all(np.isfinite(rewards)) and "roles/reward_ugv" not in row, "one role alone"
    shares = {name: value for name, value in row.items() if name.startswith("roles/")}
    assert {"roles/move_ugv", "roles/extinguish_ugv"} <= shares.keys() and 0.0 < sum(shares.values()) <= 1.0 + 1e-9


def test_a_callback_may_stop_a_training_which_then_is_evaluated_and_resumes(tmp_path):
    class Stopping:
        def on_batch(self, training, row):
            training.stop()

    run = train(TINY, callbacks=[Stopping()], folder=tmp_path / "run")
    assert run.frames == 32 and run.result.frames == 32
    assert train([f"resume={tmp_path / 'run'}"]).frames == 64
    again = train([f"resume={tmp_path / 'run'}"])
    assert (again.frames, again.result) == (64, None), "it had come to its end"


def test_an_error_of_a_callback_comes_back_and_the_others_end(tmp_path):
    class Failing:
        def on_batch(self, training, row):
            raise KeyError("mine")

    noting = Noting()
    with pytest.raises(KeyError, match="mine"):
        train(TINY, callbacks=[Failing(), noting], folder=tmp_path / "run")
    assert noting.calls == [("end", 32)]
    assert train(TINY, folder=tmp_path / "run").frames == 64, "the folder is free again"


def test_torchrl_says_nothing_of_its_buffers(tmp_path, monkeypatch):
    logger, said = logging.getLogger("torchrl"), []
    level = logger.level
    replays = ["algorithm=dqn", "algorithm.capacity=60", "algorithm.warm_up=16", "algorithm.updates=1"]
    own = [each for each in TINY if "critic_hidden" not in each]
    monkeypatch.setattr(logger, "handle", lambda record: said.append(record.getMessage()))
    train([*own, *replays, "total_frames=32", "evaluation.baselines=[]"], folder=tmp_path / "run")
    assert not said and logger.level == level


@pytest.mark.parametrize(
    ("given", "told"),
    [
        ({"overrides": "scenario=single"}, r"overrides must be a list of texts, \['scenario=single'\], got the text"),
        ({"overrides": [["a"]]}, "overrides must be a list of texts, got"),
        ({"total_frame": 64}, "total_frame is not a key of the configuration: did you mean total_frames"),
        ({"landscape": Array(cover=np.ones((16, 16)))}, "landscape must be an option and plain values, which a run"),
        ({"callbacks": [object()]}, "callbacks must be objects with some of on_batch"),
        ({"n_worlds": 0}, "n_worlds must be in"),
    ],
)
def test_a_mistake_is_refused_in_a_line_before_any_work(tmp_path, given, told):
    with pytest.raises(ValueError, match=told) as error:
        train(folder=tmp_path / "run", **given)
    assert "\n" not in str(error.value) and not (tmp_path / "run").exists()


def test_a_folder_that_holds_another_run_is_refused(trained, tmp_path):
    with pytest.raises(ConfigError, match=f"{trained[0].folder} holds a run already"):
        train([*TINY, "seed=1"], folder=trained[0].folder)
    with pytest.raises(ConfigError, match="folder must be left out with resume="):
        train([f"resume={trained[0].folder}"], folder=tmp_path)


def test_a_run_is_evaluated_elsewhere(trained):
    result = evaluate(trained[0], landscape={"size": 14}, evaluation={"episodes": 3})
    assert len(result.episodes["saved"]) == 3 and result.frames == 64 and result.folder is None
    assert list(result.world_overrides)[:1] == ["landscape.size=14"]


CELL = """
from warp_torchrl import train

class Callback:
    def on_batch(self, training, row):
        print("batch", training.frames)

    def on_end(self, training):
        print("end", training.frames)

run = train({tiny!r}, callbacks=[Callback()], folder={folder!r})
print(run.result.policy)
try:
    train(["n_worlds=0"])
except ValueError as error:
    print(error)
"""


@pytest.mark.slow
def test_it_works_in_a_notebook(tmp_path):
    nbformat, nbclient = pytest.importorskip("nbformat"), pytest.importorskip("nbclient")
    cell = nbformat.v4.new_code_cell(CELL.format(tiny=TINY, folder=str(tmp_path / "run")))
    book = nbclient.NotebookClient(nbformat.v4.new_notebook(cells=[cell]), kernel_name="python3").execute()
    said = "".join(each["text"] for each in book.cells[0].outputs if each.get("name") == "stdout").splitlines()
    assert said[:3] == ["batch 32", "batch 64", "end 64"] and said[3] == "trained, sampled"
    assert said[4].startswith("n_worlds must be in")
