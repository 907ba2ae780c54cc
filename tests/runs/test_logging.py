"""A tracker that fails does not end the run."""

import pytest

from warp_torchrl.runs.logging import CsvOnly, Tensorboard, Wandb, _TorchRlTracker


def test_a_tracker_that_cannot_open_warns_once_and_is_silent(tmp_path, caplog):
    tracker = _TorchRlTracker("no such tracker", tmp_path)
    tracker.log({"a": 1.0}, 1)
    tracker.close()
    assert [record.levelname for record in caplog.records if record.name == "warp_torchrl"] == ["WARNING"]
    assert "goes on without it" in caplog.text


def test_a_tracker_that_breaks_on_the_way_warns_once(tmp_path, caplog):
    tracker = _TorchRlTracker("csv", tmp_path)

    def broken(*args, **kwargs):
        raise OSError("server gone")

    tracker._logger.log_scalar = broken
    tracker.log({"a": 1.0}, 1)
    tracker.log({"a": 2.0}, 2)
    assert caplog.text.count("server gone") == 1


def test_the_default_tracker_says_nothing(tmp_path):
    tracker = CsvOnly().open(tmp_path)
    tracker.log({"a": 1.0}, 1)
    tracker.close()
    assert not list(tmp_path.iterdir())


def test_wandb_works_offline(tmp_path, caplog, monkeypatch):
    monkeypatch.delenv("WANDB_API_KEY", raising=False)
    tracker = Wandb().open(tmp_path)
    tracker.log({"world/saved": 0.5, "train/loss": None}, 10)
    tracker.close()
    assert "goes on without it" not in caplog.text
    assert any("offline-run" in path.name for path in tmp_path.rglob("*"))


def test_the_runs_of_a_sweep_are_one_group(tmp_path, monkeypatch):
    given = []
    monkeypatch.setattr("warp_torchrl.runs.logging.get_logger", lambda *args, **options: given.append(options))
    (tmp_path / "sweep" / "3").mkdir(parents=True)
    (tmp_path / "alone").mkdir()
    (tmp_path / "sweep" / "multirun.yaml").touch()
    Wandb().open(tmp_path / "sweep" / "3")
    Wandb().open(tmp_path / "alone")
    Wandb(group="mine").open(tmp_path / "sweep" / "3")
    assert [each["wandb_kwargs"]["group"] for each in given] == ["sweep", None, "mine"]


def test_trackers_get_the_names_and_values_of_metrics_csv(tmp_path):
    row = {"time/frames": 64, "train/loss": 0.25, "train/approx_kl": None, "world/saved": 0.5}
    events = pytest.importorskip("tensorboard.backend.event_processing.event_accumulator")
    tracker = Tensorboard().open(tmp_path)
    tracker.log(row, 64)
    tracker.close()
    folder = next(path.parent for path in tmp_path.rglob("*tfevents*"))
    found = events.EventAccumulator(str(folder)).Reload()
    assert set(found.Tags()["scalars"]) == {name for name, value in row.items() if value is not None}
    assert [(each.step, each.value) for each in found.Scalars("world/saved")] == [(64, 0.5)]


def test_a_resumed_run_goes_on_in_its_own_events_with_one_point_a_step(tmp_path):
    events = pytest.importorskip("tensorboard.backend.event_processing.event_accumulator")
    run = tmp_path / "run"
    for begin, frames in ((0, range(1, 8)), (4, range(5, 10))):  # killed after 7, resumed from 4
        tracker = Tensorboard().open(run, begin, 7 if begin else 0)
        for each in frames:
            tracker.log({"world/saved": begin + each / 10}, each)
        tracker.close()
        run = run.rename(tmp_path / "renamed")
    (folder,) = {path.parent for path in run.rglob("*tfevents*")}
    found = events.EventAccumulator(str(folder)).Reload().Scalars("world/saved")
    assert [each.step for each in found] == list(range(1, 10))
    assert [round(each.value, 1) for each in found] == [0.1, 0.2, 0.3, 0.4, 4.5, 4.6, 4.7, 4.8, 4.9]


def test_a_resumed_run_is_one_run_of_wandb_with_one_point_a_step(tmp_path, monkeypatch):
    class Logger:
        def __init__(self):
            self.steps = []
            made.append(self)

        def log_scalar(self, name, value, step):
            self.steps.append(step)

    made, given = [], []
    monkeypatch.setattr(
        "warp_torchrl.runs.logging.get_logger",
        lambda *names, wandb_kwargs: given.append(wandb_kwargs["id"]) or Logger(),
    )
    for begin, told, frames in ((0, 0, range(1, 8)), (4, 7, range(5, 10)), (0, 0, range(1, 3))):
        tracker = Wandb().open(tmp_path, begin, told)
        for each in frames:
            tracker.log({"world/saved": 0.5}, each)
    assert [each.steps for each in made] == [[1, 2, 3, 4, 5, 6, 7], [8, 9], [1, 2]]
    assert given[0] == given[1] != given[2], "a run that begins anew is another one"
    (tmp_path / "wandb_id").write_text("../../else")
    Wandb().open(tmp_path, 4, 7)
    assert given[3] not in ("../../else", given[2]) and given[3].isalnum()


def test_wandb_gets_the_names_of_metrics_csv(tmp_path, monkeypatch):
    monkeypatch.delenv("WANDB_API_KEY", raising=False)
    tracker = Wandb().open(tmp_path)
    seen = []
    monkeypatch.setattr(tracker._logger.experiment, "log", lambda values, **options: seen.append(values))
    tracker.log({"world/saved": 0.5, "train/loss": None, "time/frames": 10}, 10)
    tracker.close()
    assert [name for each in seen for name in each if not name.endswith("/step")] == ["world/saved", "time/frames"]


def test_tensorboard_works_where_it_is_installed(tmp_path, caplog):
    pytest.importorskip("tensorboard")
    tracker = Tensorboard().open(tmp_path)
    tracker.log({"world/saved": 0.5}, 10)
    tracker.close()
    assert "goes on without it" not in caplog.text and any("tfevents" in path.name for path in tmp_path.rglob("*"))
