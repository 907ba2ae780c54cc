"""Episodes that are paired, and the report."""

import json

import pytest
import torch

from tests.conftest import small_world
from warp_torchrl.evaluation import play as play_module
from warp_torchrl.evaluation.behaviour import BEHAVIOUR
from warp_torchrl.evaluation.play import WithoutAgent, play
from warp_torchrl.evaluation.report import evaluation_table, report, write_json
from warp_torchrl.heuristics import Coordinated, Greedy, NoOp, Random


def test_policies_meet_the_same_worlds_and_the_generator_is_left_alone(make_small_env):
    env = make_small_env(3)
    before = torch.get_rng_state()
    first, again = play(env, NoOp(env), 70), play(env, NoOp(env), 70)
    play(env, Random(env), 70)
    assert (first["saved"] == again["saved"]).all() and (torch.get_rng_state() == before).all()


def test_every_world_is_played_to_its_own_end(make_small_env):
    env = make_small_env(4)
    episodes = play(env, NoOp(env), 5)
    assert env.world_state.done.all()
    assert ((episodes["control_time"] == 1.0) | (episodes["burning"] == 0.0)).all()


def test_a_long_play_says_how_far_it_is(make_small_env, monkeypatch, caplog):
    monkeypatch.setattr(play_module, "_SECONDS", -1.0)
    env = make_small_env(n_worlds=3)
    random = Random(env)
    random.is_stateful = True  # so that it plays step by step
    with caplog.at_level("INFO", "warp_torchrl"):
        play(env, random, 100)
    assert f"step 1 of {env.world.horizon} at most: 0 of 3 episodes have ended" in caplog.messages
    monkeypatch.setattr(play_module, "_SECONDS", 60.0)
    caplog.clear()
    play(env, random, 100)
    assert not caplog.messages


def test_the_report_has_what_the_contract_says(make_small_env, tmp_path):
    env = make_small_env(3)
    mine, noop = play(env, Random(env), 9), play(env, NoOp(env), 9)
    content = report("tiny", "random", 9, mine, {"noop": noop})
    write_json(tmp_path / "evaluation.json", content)
    read = json.loads((tmp_path / "evaluation.json").read_text())
    assert read["seeds"] == [9, 10, 11] and read["scenario"] == "tiny" and read["policy"] == "random"
    assert set(read["metrics"]["saved"]) >= {"iqm", "mean", "ci95"}
    assert read["episodes"][1]["seed"] == 10 and 0.0 <= read["episodes"][1]["saved"] <= 1.0
    assert set(read["versus"]["noop"]) >= {"saved_difference", "ci95", "probability_of_improvement"}
    # The twin without a team, on the same draws: what was averted, world by world.
    for index in range(3):
        averted = read["episodes"][index]["averted"]
        assert averted == pytest.approx(mine["saved"][index] - noop["saved"][index])
    assert "random - noop" in evaluation_table(read) and "tiny: 3 fires" in evaluation_table(read)


def test_a_report_has_no_number_where_there_is_none(make_small_env, tmp_path):
    env = make_small_env(3)
    idle = play(env, NoOp(env), 9, watch=True)
    content = report("tiny", "noop", 9, idle, {})
    write_json(tmp_path / "evaluation.json", content)
    read = json.loads((tmp_path / "evaluation.json").read_text())
    assert read["metrics"]["lead_time"]["mean"] is None and read["episodes"][0]["head_attack"] is None
    assert "lead time" not in evaluation_table(read)


def test_behaviour_is_seen_only_where_it_is_asked_for(make_small_env):
    env = make_small_env(3)
    assert not set(BEHAVIOUR) & set(play(env, Greedy(env), 9))
    watched = play(env, Greedy(env), 9, watch=True)
    assert set(BEHAVIOUR) <= set(watched) and env.watcher is None
    assert (watched["saved"] == play(env, Greedy(env), 9)["saved"]).all()


def test_a_team_without_an_agent_does_worse(make_small_env):
    env = make_small_env(32)
    whole = play(env, Coordinated(env), 0)
    lamed = play(env, WithoutAgent(Coordinated(env), 1, env.world.team), 0)
    assert whole["saved"].mean() > lamed["saved"].mean() + 0.05
    content = report("tiny", "coordinated", 0, whole, {}, left_out={"bulldozer_1": lamed})
    assert content["left_out"]["bulldozer_1"]["saved_difference"] > 0.05
    assert "without bulldozer_1" in evaluation_table(content)


def test_the_agent_left_out_stays_where_it_is(make_small_env):
    env = make_small_env(4)
    now = env.reset()
    start = env.world_state.vehicles.position.clone()
    policy = WithoutAgent(Greedy(env), 0, env.world.team)
    for _ in range(10):
        now = env.step(policy(now))["next"]
    after = env.world_state.vehicles.position
    assert (after[:, 0] == start[:, 0]).all() and (after[:, 1] != start[:, 1]).any()


@pytest.mark.parametrize("fits_abreast", [True, False])
def test_heuristics_play_side_by_side_while_their_cells_fit(make_small_env, monkeypatch, fits_abreast):
    env, asked = make_small_env(3, small_world(horizon=4)), []
    abreast = play_module.play_abreast
    monkeypatch.setattr(play_module, "play_abreast", lambda *given: asked.append(given[2]) or abreast(*given))
    monkeypatch.setattr(play_module, "_CELLS_ABREAST", 2 * 3 * 12 * 12 - (not fits_abreast))
    play_module.play_heuristics(env, 5, ["noop", "greedy"])
    assert asked == ([["noop", "greedy"]] if fits_abreast else [])
