"""The benchmark prints what it measured."""

import json

import numpy as np

from warp_torchrl.benchmark.__main__ import main
from warp_torchrl.benchmark.tasks import disagreements


def test_it_prints_tables(capsys):
    main(["env", "tasks", "--scenario", "skirmish", "--worlds", "2", "--episodes", "3", "--set", "horizon=8"])
    out = capsys.readouterr().out
    assert "environment skirmish" in out and "| skirmish |" in out and "torchrl" in out


def test_it_prints_json(capsys):
    main(["train", "--scenario", "skirmish", "--worlds", "2", "--json", "--set", "collector.steps=4"])
    content = json.loads(_json(capsys.readouterr().out))
    (row,) = content["speed"]
    assert row["what"] == "training" and row["lowest"] <= row["agent_steps_per_second"] <= row["highest"]


def test_it_measures_environment_and_training_by_default(capsys):
    main(["--scenario", "skirmish", "--worlds", "2", "--set", "collector.steps=4", "horizon=8"])
    out = capsys.readouterr().out
    assert "environment skirmish" in out and "training    skirmish" in out


def test_it_ranks_the_rewards(capsys):
    main(["rewards", "--scenario", "skirmish", "--episodes", "4", "--set", "landscape.size=12", "horizon=30"])
    out = capsys.readouterr().out
    for name in ("saved", "efficiency", "time", "coverage", "collaborative", "adaptive", "paper"):
        assert f"| skirmish | {name} |" in out


def test_only_sure_differences_disagree():
    saved = {"one": np.array([0.1, 0.2, 0.3]), "other": np.array([0.5, 0.6, 0.7])}
    assert disagreements({"one": np.array([0.9, 0.9, 0.8]), "other": np.zeros(3)}, saved) == ["one and other"]
    assert disagreements({"one": np.array([0.9, -0.9, 0.1]), "other": np.zeros(3)}, saved) == []
    assert disagreements(saved, saved) == []


def _json(text):
    return text[text.index("{\n") :]
