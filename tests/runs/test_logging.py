"""Trackers get a run's configuration, rows and evaluations; one that fails does not end the run."""

import json
import struct
import time
from types import SimpleNamespace

import numpy as np
import pytest

from warp_torchrl.evaluation.result import Result
from warp_torchrl.runs.logging import CsvOnly, Tensorboard, Tracker, Wandb

CONFIG = {"scenario": "skirmish", "algorithm": {"gamma": 0.99, "mixer": None}, "seed": 3}


def training(frames):
    """What a tracker reads of a training after these frames."""
    return SimpleNamespace(frames=frames, run_config=SimpleNamespace(kinds=[None]))


class Sent:
    """A sink that keeps what it is sent."""

    def __init__(self):
        self.values, self.shown, self.closed = [], [], 0

    def log(self, values, frames):
        self.values.append((frames, dict(values)))

    def show(self, table, rows, picture, frames):
        self.shown.append((frames, table, rows, picture))

    def close(self):
        self.closed += 1


@pytest.fixture
def picture(tmp_path):
    from PIL import Image

    frames = [Image.new("RGB", (8, 6), colour) for colour in ("red", "blue")]
    frames[0].save(tmp_path / "episode.gif", save_all=True, append_images=frames[1:])
    return tmp_path


def evaluation(folder=None):
    means = {"saved": [0.5, 0.7], "success": [0.0, 1.0], "control_time": [1.0, 1.0], "cleared": [0.0, 0.0]}
    episodes = {name: np.array(each) for name, each in {**means, "lead_time": [np.nan, np.nan]}.items()}
    wrote = ("evaluation.json", "episode.gif") if folder else ()
    idle = {name: values * 0.5 for name, values in episodes.items()}
    parts = {"baselines": {"noop": idle}, "folder": folder, "wrote": wrote} if folder else {}
    return Result(scenario="skirmish", policy="trained, sampled", first_seed=7, episodes=episodes, **parts)


def test_a_tracker_that_cannot_open_warns_once_and_is_silent(caplog):
    tracker = Tracker("strange", lambda: [].pop())
    tracker.on_batch(training(1), {"a": 1.0})
    tracker.on_evaluation(training(1), evaluation())
    tracker.on_end(training(1))
    assert [record.levelname for record in caplog.records if record.name == "warp_torchrl"] == ["WARNING"]
    assert "strange does not work, the run goes on without it: pop from empty list" in caplog.text


@pytest.mark.parametrize("broken", ["log", "show", "close"])
def test_a_tracker_that_breaks_on_the_way_warns_once(caplog, picture, broken):
    def fail(*given):
        raise OSError("server gone")

    sink = Sent()
    setattr(sink, broken, fail)
    tracker = Tracker("frail", lambda: sink)
    for frames in (1, 2):
        tracker.on_batch(training(frames), {"a": 1.0})
    tracker.on_evaluation(training(2), evaluation(picture))
    tracker.on_end(training(2))
    assert caplog.text.count("server gone") == 1


def test_the_default_is_no_tracker(tmp_path):
    assert CsvOnly().open(tmp_path, 0, 0, CONFIG) is None and not list(tmp_path.iterdir())


def test_a_tracker_is_called_once_a_batch_with_what_the_row_has():
    sink = Sent()
    tracker = Tracker("kept", lambda: sink, sent_frames=64)
    for frames in (32, 64, 96):
        tracker.on_batch(training(frames), {"train/loss": 0.25, "train/approx_kl": None, "time/frames": frames})
    assert sink.values == [(96, {"train/loss": 0.25, "time/frames": 96})], "rows that it has are not sent again"


def test_evaluations_on_the_way_and_the_last_one_have_their_names(picture):
    sink = Sent()
    tracker = Tracker("kept", lambda: sink)
    tracker.on_evaluation(training(32), evaluation())
    tracker.on_evaluation(training(64), evaluation(picture))
    means = {"success": 0.5, "control_time": 1.0, "cleared": 0.0}
    on_the_way, at_the_end = (
        {f"{part}/{name}": each for name, each in means.items()} for part in ("evaluation", "final")
    )
    assert sink.values[0] == (32, on_the_way), "the row has evaluation/saved"
    assert sink.values[1] == (64, {"final/saved": pytest.approx(0.6), **at_the_end})
    [(frames, table, rows, path)] = sink.shown
    assert frames == 64 and "trained, sampled - noop" in table and path == picture / "episode.gif"
    assert rows[0] == ["policy", "saved", "success", "control_time", "cleared", "lead_time", "averted"]
    assert rows[1] == ["noop", pytest.approx(0.3), 0.25, 0.5, 0.0, None, None]
    assert rows[2] == ["trained, sampled", pytest.approx(0.6), 0.5, 1.0, 0.0, None, pytest.approx(0.3)]


def records(path):
    """The records of a file of wandb, which is a log of LevelDB: blocks of 32 KiB with pieces of records."""
    data, place, held = path.read_bytes(), 7, b""  # after the header
    while place + 7 <= len(data):
        if (left := 2**15 - place % 2**15) < 7:
            place += left
            continue
        _, length, kind = struct.unpack("<IHB", data[place : place + 7])
        held += data[place + 7 : place + 7 + length]
        place += 7 + length
        if kind in (1, 4):  # whole, or the last piece
            yield held
            held = b""


def decoded(folder):
    """What the runs of wandb in a folder hold: configuration, rows by step, and numbers of runs."""
    from wandb.proto import wandb_internal_pb2

    config, rows, ids = {}, {}, set()
    for path in sorted(folder.rglob("*.wandb")):
        for data in records(path):
            record = wandb_internal_pb2.Record()
            record.ParseFromString(data)
            if record.WhichOneof("record_type") == "run":
                ids.add(record.run.run_id)
            for update in [*record.run.config.update, *record.config.update]:
                config[update.key or ".".join(update.nested_key)] = json.loads(update.value_json)
            values = {i.key or ".".join(i.nested_key): json.loads(i.value_json) for i in record.history.item}
            if values:
                rows.setdefault(values["_step"], []).append(values)
    return config, rows, ids


def test_a_run_of_wandb_has_configuration_rows_and_evaluation(picture, caplog, monkeypatch):
    monkeypatch.delenv("WANDB_API_KEY", raising=False)
    for begin, sent, steps in ((0, 0, (32, 64)), (32, 64, (64, 96))):  # killed after 64, resumed from 32
        tracker = Wandb().open(picture, begin, sent, CONFIG)
        for frames in steps:
            tracker.on_batch(training(frames), {"world/saved": frames / 100, "train/loss": None})
        if begin:
            tracker.on_evaluation(training(96), evaluation(picture))
        tracker.on_end(training(96))
        if not begin:
            time.sleep(1.0)  # wandb names its folders by the second
    assert "goes on without it" not in caplog.text
    config, rows, ids = decoded(picture)
    assert {key: config[key] for key in CONFIG} == CONFIG
    assert sorted(rows) == [32, 64, 96] and [len(each) for each in rows.values()] == [1, 1, 1], "one row a step"
    assert ids == {(picture / "wandb_id").read_text()}, "one run"
    last = rows[96][0]
    assert last["world/saved"] == 0.96 and last["final/saved"] == pytest.approx(0.6)
    assert last["final/table._type"] == "table-file" and last["final/episode._type"] == "video-file"
    [table] = picture.rglob("*.table.json")
    assert [line[0] for line in json.loads(table.read_text())["data"]] == ["noop", "trained, sampled"]


def test_a_run_that_begins_anew_is_another_one_of_wandb(tmp_path, monkeypatch):
    numbers = []
    monkeypatch.setattr("warp_torchrl.runs.logging._WandbRun", lambda run, config, **more: numbers.append(more["id"]))
    for begin in (0, 32, 0):
        Wandb().open(tmp_path, begin, begin, CONFIG)
    assert numbers[0] == numbers[1] != numbers[2]
    (tmp_path / "wandb_id").write_text("../../else")
    Wandb().open(tmp_path, 32, 32, CONFIG)
    assert numbers[3] not in ("../../else", numbers[2]) and numbers[3].isalnum()


def test_the_runs_of_a_sweep_are_one_group(tmp_path, monkeypatch):
    groups = []
    monkeypatch.setattr("warp_torchrl.runs.logging._WandbRun", lambda run, config, **more: groups.append(more["group"]))
    (tmp_path / "sweep" / "3").mkdir(parents=True)
    (tmp_path / "alone").mkdir()
    (tmp_path / "sweep" / "multirun.yaml").touch()
    Wandb().open(tmp_path / "sweep" / "3", 0, 0, CONFIG)
    Wandb().open(tmp_path / "alone", 0, 0, CONFIG)
    Wandb(group="mine").open(tmp_path / "sweep" / "3", 0, 0, CONFIG)
    assert groups == ["sweep", None, "mine"]


def test_a_run_of_tensorboard_has_configuration_rows_and_evaluation(picture, caplog):
    events = pytest.importorskip("tensorboard.backend.event_processing.event_accumulator")
    run = picture.rename(picture.with_name("run"))
    for begin, frames in ((0, range(1, 8)), (4, range(5, 10))):  # killed after 7, resumed from 4
        tracker = Tensorboard().open(run, begin, 7 if begin else 0, CONFIG)
        for each in frames:
            tracker.on_batch(training(each), {"world/saved": begin + each / 10, "train/approx_kl": None})
        if begin:
            tracker.on_evaluation(training(9), evaluation(run))
        tracker.on_end(training(9))
        run = run.rename(picture.with_name("renamed"))
    assert "goes on without it" not in caplog.text
    (folder,) = {path.parent for path in run.rglob("*tfevents*")}
    found = events.EventAccumulator(str(folder)).Reload()
    assert set(found.Tags()["scalars"]) == {
        "world/saved", "final/saved", "final/success", "final/control_time", "final/cleared",
    }  # fmt: skip
    points = found.Scalars("world/saved")
    assert [each.step for each in points] == list(range(1, 10)), "one point a step"
    assert [round(each.value, 1) for each in points] == [0.1, 0.2, 0.3, 0.4, 4.5, 4.6, 4.7, 4.8, 4.9]
    texts = {tag: found.Tensors(tag)[-1].tensor_proto.string_val[0].decode() for tag in found.Tags()["tensors"]}
    assert '"gamma": 0.99' in texts["config/text_summary"] and "noop" in texts["final/table/text_summary"]
    assert found.Images("final/episode")[0].encoded_image_string[:3] == b"GIF"
    hparams = found.summary_metadata["_hparams_/session_start_info"].plugin_data.content
    assert b"algorithm.gamma" in hparams
