"""What is told of a policy: its baselines, which are not played again in worlds that were met before."""

import json
from pathlib import Path

import pytest

from warp_torchrl.evaluation import evaluate as evaluation_module
from warp_torchrl.evaluation.play import play_heuristics
from warp_torchrl.runs.config.building import run_config
from warp_torchrl.runs.config.compose import compose_config
from warp_torchrl.runs.config.construction import ConfigError
from warp_torchrl.runs.config.plain_values import plain

TINY = ["landscape.size=12", "horizon=16", "evaluation.episodes=3", "evaluation.cache=false"]


def test_the_jobs_of_a_sweep_play_the_baselines_once(monkeypatch):
    asked = []

    def note(env, first_seed, names):
        asked.append(list(names))
        return play_heuristics(env, first_seed, names)

    monkeypatch.setattr(evaluation_module, "play_heuristics", note)
    monkeypatch.setattr(evaluation_module, "_PLAYED", {})

    def baselines(names, *overrides):
        plan = run_config(plain(compose_config("train", [*TINY, *overrides])))
        return evaluation_module._baselines(plan, plan.make_env(3, plan.evaluation.first_seed), names)

    first = baselines(["noop", "local"])
    again = baselines(["local", "noop"], "seed=7", "algorithm=ppo")
    assert asked == [["noop", "local"], []] and again["local"] is first["local"]
    more = baselines(["greedy", "local"], "seed=8")
    assert asked[2] == ["greedy"] and list(more) == ["greedy", "local"]
    baselines(["noop"], "wind.speed=9")
    assert asked[3] == ["noop"], "other worlds"


@pytest.mark.parametrize("names", [[], ["local"], ["local", "noop"]])
def test_a_run_names_its_baselines(names: list[str], tmp_path: Path) -> None:
    chosen = f"evaluation.baselines=[{','.join(names)}]"
    plan = run_config(plain(compose_config("train", [*TINY, chosen])))
    evaluation_module.evaluate_policy(plan, tmp_path, "noop", [], picture=None)
    shown = json.loads((tmp_path / "evaluation.json").read_text())["baselines"]
    assert list(shown) == [name for name in names if name != "noop"], "a policy is no baseline of its own"


def test_a_baseline_must_be_known() -> None:
    with pytest.raises(ConfigError, match=r"evaluation.baselines must be of .*, got dispatc: did you mean dispatch"):
        run_config(plain(compose_config("train", ["evaluation.baselines=[dispatc]"])))
