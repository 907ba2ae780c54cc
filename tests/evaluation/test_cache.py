"""Baselines are played once for each world, and what is kept of them is believed only where it is as it was written."""

import json
import logging

import numpy as np
import pytest
import torch

from tests.env.scenarios import FURTHER, OF_MECHANICS
from warp_torchrl.evaluation import cache
from warp_torchrl.evaluation import evaluate as evaluation_module
from warp_torchrl.evaluation.play import play_heuristics
from warp_torchrl.heuristics import HEURISTICS, NoOp
from warp_torchrl.runs.config.building import run_config
from warp_torchrl.runs.config.compose import compose_config
from warp_torchrl.runs.config.plain_values import plain
from warp_torchrl.world.terrain.array import Array

TINY = ["evaluation.episodes=3", "landscape.size=12", "horizon=16"]


@pytest.fixture(autouse=True)
def _own_folder(tmp_path, monkeypatch):
    monkeypatch.setenv("XDG_CACHE_HOME", str(tmp_path))


def plan_of(*overrides, scenario="skirmish"):
    return run_config(plain(compose_config("train", [f"scenario={scenario}", *TINY, *overrides])))


def played(plan, names=("noop", "greedy")):
    return play_heuristics(plan.make_env(3, plan.evaluation.first_seed), plan.evaluation.first_seed, names)


def test_what_is_kept_is_what_was_played():
    plan = plan_of()
    assert cache.cached(plan, ["noop"]) == {}
    episodes = played(plan)
    cache.store(plan, episodes)
    found = cache.cached(plan_of("seed=5", "algorithm=ppo", "observation.radius=2"), ["noop", "greedy", "local"])
    assert found.keys() == episodes.keys()
    for name, metrics in episodes.items():
        assert all(np.array_equal(found[name][metric], values) for metric, values in metrics.items())
        assert found[name].keys() == metrics.keys()


@pytest.mark.parametrize(
    "change",
    ["wind.speed=5", "evaluation.first_seed=2_000_000", "reward=time", "team.tank=3", "horizon=17", "fire.beta=0.01"],
)
def test_other_worlds_have_other_files(change):
    cache.store(plan_of(), played(plan_of()))
    assert cache.cached(plan_of(change), ["noop", "greedy"]) == {}


def test_another_code_has_other_files(monkeypatch):
    cache.store(plan_of(), played(plan_of()))
    monkeypatch.setattr(cache, "code_digest", lambda: "another")
    assert cache.cached(plan_of(), ["noop", "greedy"]) == {}


@pytest.mark.parametrize(
    "alter",
    [
        lambda text: text[:-20],
        lambda text: text.replace("0.", "1.", 1),
        lambda text: "[]",
        lambda text: json.dumps({"sha256": 3, "episodes": None}),
    ],
    ids=["cut", "altered", "a list", "nothing"],
)
def test_an_altered_file_is_not_believed_and_is_replaced(alter, caplog):
    plan = plan_of()
    episodes = played(plan)
    cache.store(plan, episodes)
    for path in cache.folder().iterdir():
        path.write_text(alter(path.read_text()))
    with caplog.at_level(logging.WARNING, "warp_torchrl"):
        assert cache.cached(plan, ["noop", "greedy"]) == {}
    assert "the baselines are played again" in caplog.text
    cache.store(plan, episodes)
    assert len(cache.cached(plan, ["noop", "greedy"])) == 2
    assert all(path.suffix == ".json" for path in cache.folder().iterdir()), "no drafts are left"


def test_a_folder_that_cannot_be_written_is_no_error(monkeypatch, tmp_path):
    (tmp_path / "file").write_text("")
    monkeypatch.setenv("XDG_CACHE_HOME", str(tmp_path / "file"))
    cache.store(plan_of(), played(plan_of()))
    assert cache.cached(plan_of(), ["noop"]) == {}


def test_it_can_be_turned_off():
    plan = plan_of("evaluation.cache=false")
    cache.store(plan, played(plan))
    assert not cache.folder().exists()


def test_two_evaluations_in_two_processes_play_the_baselines_once(monkeypatch):
    asked = []

    def note(env, first_seed, names):
        asked.append(list(names))
        return play_heuristics(env, first_seed, names)

    monkeypatch.setattr(evaluation_module, "play_heuristics", note)
    for names in (["noop"], ["noop", "local"]):
        monkeypatch.setattr(evaluation_module, "_PLAYED", {})  # as another process begins
        plan = plan_of()
        evaluation_module._baselines(plan, plan.make_env(3, plan.evaluation.first_seed), names)
    assert asked == [["noop"], ["local"]]


def test_layers_count_by_what_they_hold():
    forest, lake = ([[code] * 12] * 12 for code in (3, 0))
    mixed = [*forest[:-1], lake[0]]
    assert cache.digest(Array(cover=forest)) == cache.digest(Array(cover=[row[:] for row in forest]))
    assert cache.digest(Array(cover=forest)) != cache.digest(Array(cover=mixed))
    assert cache.digest(torch.zeros(2)) != cache.digest(torch.zeros(2, dtype=torch.int64))
    assert cache.digest([["a"], "b"]) != cache.digest([["a", "b"]])


def test_a_file_counts_by_what_it_is(tmp_path):
    file = tmp_path / "fire.geojson"
    file.write_text("1")
    before = cache.digest([str(file)])
    file.write_text("12")
    assert cache.digest([str(file)]) != before


def test_copies_of_layers_on_devices_do_not_count():
    assert cache.digest({torch.device("cpu"): object()}) == cache.digest({torch.device("meta"): object()})
    assert cache.digest({"a": 1}) != cache.digest({"a": 2})


SCENARIOS = ("default", "hazard", "water", "lightning", "paper_marl", "shift")
TOLD = [(f"scenario={each}",) for each in SCENARIOS] + [FURTHER[name] for name in OF_MECHANICS if name in FURTHER]


@pytest.mark.parametrize("overrides", TOLD, ids=" ".join)
def test_all_that_episodes_of_a_scenario_follow_from_can_be_told(overrides):
    scenario, *rest = overrides
    plan = plan_of(*rest, scenario=scenario.removeprefix("scenario="))
    assert len(cache._paths(plan, list(HEURISTICS))) == len(HEURISTICS)


def test_what_a_user_adds_is_not_kept(monkeypatch):
    class Mine(NoOp):
        pass

    monkeypatch.setitem(HEURISTICS, "noop", Mine)
    assert cache._paths(plan_of(), ["noop"]) == {}
    with pytest.raises(cache.Unknown, match="a function"):
        cache.digest([lambda: None])


def test_the_rooms_whose_code_plays_episodes_are_there():
    assert all((cache._PACKAGE / room).is_dir() for room in cache._SOURCES)
