"""Evaluations from Python: of baselines, shipped policies, and policies of one's own, on any ground."""

import json

import numpy as np
import pytest

from warp_torchrl import Array, evaluate, load_policy, make_env
from warp_torchrl.heuristics import Greedy
from warp_torchrl.runs.config.construction import ConfigError

FEW = {"evaluation": {"episodes": 2, "baselines": ["noop"]}, "horizon": 8}


def test_a_baseline_is_evaluated_and_nothing_is_written(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    result = evaluate("local", "single", **FEW)
    assert result.scenario == "single" and result.policy == "local" and list(result.baselines) == ["noop"]
    assert result.episodes["saved"].shape == (2,) and "local - noop" in str(result)
    assert not list(tmp_path.iterdir())


def test_it_is_written_where_it_is_wanted(tmp_path):
    result = evaluate("noop", folder=tmp_path / "seen", picture=None, **FEW)
    assert json.loads((tmp_path / "seen" / "evaluation.json").read_text()) == result.report
    with pytest.raises(ConfigError, match=r"folder: .* holds an evaluation"):
        evaluate("noop", folder=tmp_path / "seen", **FEW)


def test_a_loaded_policy_does_as_by_its_name():
    ours, theirs = (evaluate(policy, "skirmish", **FEW) for policy in (load_policy("skirmish"), "skirmish"))
    assert ours.policy == theirs.policy and ours.episodes["saved"].tolist() == theirs.episodes["saved"].tolist()


def test_a_policy_of_ones_own_is_evaluated_on_a_map_of_ones_own():
    # A column of ground that cannot burn: baselines of another map would save another share.
    cover = np.full((14, 16), 2)
    means = []
    for column in (4, 8):
        ground = Array(cover=np.where(np.arange(16) == column, 0, cover))
        policy = Greedy(make_env("skirmish", landscape=ground, n_worlds=2, horizon=8))
        with pytest.raises(ConfigError, match="policy must be a name, a folder, a run or a TensorDictModule"):
            evaluate(print, "skirmish", landscape=ground)
        result = evaluate(policy, "skirmish", landscape=ground, ignition={"region": 1.0}, **FEW)
        means.append(result.baselines["noop"]["saved"].tolist())
        assert result.policy == "Greedy" and list(result.world_overrides)[-1] == "landscape"
    assert means[0] != means[1]
