"""The benchmark prints what it measured."""

import json

from warp_torchrl.benchmark import main


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


def _json(text):
    return text[text.index("{\n") :]
