"""What a card is asked in a few minutes runs, in small, on a CPU, and is written down part by part."""

import json
from dataclasses import replace

import pytest
import torch

from warp_torchrl.benchmark import gpu
from warp_torchrl.benchmark.__main__ import main
from warp_torchrl.benchmark.gpu import SMALL, measure_gpu

ONE = replace(SMALL, worlds=(2,), ways=("eager",))


def test_everything_is_measured_and_written(tmp_path, capsys):
    path = tmp_path / "figures.json"
    main(["gpu", "--device", "cpu", "--file", str(path)])
    found = json.loads(path.read_text())
    parts = ["equality", "starts", "waits", "steps 2", "steps 4", "training eager", "training graph"]
    assert [name for name in found if name not in ("machine", "scenario", "seconds")] == parts
    assert len(capsys.readouterr().out.splitlines()) == len(parts)
    assert found["machine"]["torch"] == torch.__version__ and found["seconds"] > 0.0
    assert found["equality"]["differing"] == {} and max(found["equality"]["furthest"].values()) < 1e-5
    assert found["starts"] == {"worlds": 8, "differing": {}}
    assert found["waits"]["step"] <= 1 and 0 < found["waits"]["iteration"] <= 3
    assert sum(found["waits"]["places"].values()) == found["waits"]["step"] + found["waits"]["iteration"]
    for name in parts[3:5]:
        assert {"eager", "graph", "tick", "peak_gib"} == set(found[name])
        assert found[name]["tick"]["cells_per_second"] > 0.0
    for row in (found["steps 4"]["graph"], found["training graph"]):
        assert 0.0 < row["lowest"] <= row["agent_steps_per_second"] <= row["highest"]
    assert found["training eager"]["peak_gib"] > 0.0


def test_the_large_one_holds_what_was_asked():
    size = gpu.Size()
    assert size.worlds[0] == 256 and size.worlds[-1] == 16384 and size.seconds < 300.0
    assert size.training == ("experiment=gpu",) and size.ways == ("eager", "graph", "compiled")


def test_worlds_that_differ_are_told(tmp_path, monkeypatch):
    make, seeds = gpu.make_env, iter((1, 2))

    def other(scenario, **options):
        return make(scenario, seed=next(seeds), **options)

    monkeypatch.setattr(gpu, "make_env", other)
    measure_gpu("cpu", tmp_path / "gpu.json", replace(ONE, worlds=(), ways=()), progress=lambda line: None)
    assert "cells" in json.loads((tmp_path / "gpu.json").read_text())["equality"]["differing"]


def test_a_part_that_fails_does_not_take_the_others_along(tmp_path, monkeypatch, capsys):
    def broken(*given):
        raise RuntimeError("no such kernel")

    monkeypatch.setattr(gpu, "_waits", broken)
    monkeypatch.setattr("warp_torchrl.benchmark.__main__.SMALL", ONE)
    with pytest.raises(SystemExit) as end:
        main(["gpu", "--device", "cpu", "--file", str(tmp_path / "gpu.json")])
    found = json.loads((tmp_path / "gpu.json").read_text())
    assert end.value.code == 1 and "a part was not measured" in capsys.readouterr().err
    assert found["waits"]["error"] == "RuntimeError: no such kernel" and "broken" in found["waits"]["traceback"]
    assert found["training eager"]["agent_steps_per_second"] > 0.0


@pytest.mark.slow
def test_a_way_that_fails_does_not_take_the_others_along(tmp_path, monkeypatch):
    def broken(way, *given):
        raise RuntimeError("no such kernel")

    monkeypatch.setattr(gpu, "_steps_by", broken)
    assert not measure_gpu("cpu", tmp_path / "gpu.json", ONE, progress=lambda line: None)
    found = json.loads((tmp_path / "gpu.json").read_text())["steps 2"]
    assert found["error"] == found["eager"]["error"] == "RuntimeError: no such kernel"
    assert found["tick"]["cells_per_second"] > 0.0


def test_no_part_begins_late(tmp_path):
    assert measure_gpu("cpu", tmp_path / "gpu.json", replace(ONE, seconds=-1.0), progress=lambda line: None)
    assert json.loads((tmp_path / "gpu.json").read_text())["waits"] == {"skipped": "-1 s had passed"}


def test_without_a_card_one_line_says_so(capsys, monkeypatch):
    monkeypatch.setattr(torch.cuda, "is_available", lambda: False)
    with pytest.raises(SystemExit) as end:
        main(["gpu"])
    told = capsys.readouterr().err.splitlines()
    assert end.value.code == 2 and len(told) == 1 and "no CUDA device" in told[0]
