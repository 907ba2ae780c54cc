"""The benchmark prints what it measured, against a NumPy world that plays the same law."""

import json

import numpy as np
import pytest
import torch
from pettingzoo.test import parallel_api_test

from warp_torchrl import make_env
from warp_torchrl.benchmark import environments, machine, scaling, stable_baselines
from warp_torchrl.benchmark.__main__ import main
from warp_torchrl.benchmark.numpy_env import NumpyFireEnv
from warp_torchrl.benchmark.numpy_team import NumpyTeam
from warp_torchrl.benchmark.numpy_terrain import new_ground
from warp_torchrl.benchmark.shares import training_shares
from warp_torchrl.benchmark.tasks import disagreements
from warp_torchrl.benchmark.ticks import numpy_copy
from warp_torchrl.benchmark.timing import mean_rate
from warp_torchrl.runs.config.building import run_config
from warp_torchrl.runs.config.compose import compose_config
from warp_torchrl.runs.config.plain_values import plain
from warp_torchrl.runs.config.saved_config import SavedConfig
from warp_torchrl.training.loop import Training
from warp_torchrl.world.arrays.random import Stream, uniform
from warp_torchrl.world.state.state import Action

TINY = ["--scenario", "spread_skirmish", "--worlds", "2", "--repeats", "1", "--set", "horizon=8", "collector.steps=4"]


def output(capsys, *arguments):
    main(list(arguments))
    return capsys.readouterr().out


@pytest.mark.slow
def test_a_prediction_is_measured_as_a_process_of_its_own(capsys):
    pytest.importorskip("rasterio")
    out = json.loads(output(capsys, "predict", "--sides", "60", "--hours", "1", "--json"))
    (row,) = out["predict"]
    assert row["cells"] == "60 x 60" and row["hours"] == 1
    assert float(row["CPU s"]) > 0 and 0.1 < float(row["memory GB"]) < 4.0


def test_twin_experiments_are_a_row_for_each_size_of_ensembles(capsys):
    out = output(capsys, "twins", "--twins", "1", "--members", "2", "3", "--hidden", "uneven")
    rows = [line for line in out.splitlines() if line.startswith("uneven ground")]
    assert len(rows) == 2 and "head within 20 %" in out and rows[0].count(" of 1") == 4
    with pytest.raises(SystemExit):
        main(["twins", "--hidden", "nothing"])
    assert "hidden must begin one of rate, wind, moisture; " in capsys.readouterr().err


def test_the_tick_is_compared_with_numpy(capsys):
    out = output(capsys, "tick", "--no-compile", *TINY)
    assert "ns/cell" in out and "\neager " in out and "\nnumpy " in out
    out = output(capsys, "tick", "--no-compile", *TINY, "wind=wandering")
    assert "numpy was skipped: it plays law paper in a wind that stays as it is" in out


@pytest.mark.parametrize("mistake", [["--scenario", "larg"], ["--set", "landscape.size=2"]])
@pytest.mark.parametrize("what", ["tick", "train"])
def test_a_mistake_is_told_in_one_line(capsys, what, mistake):
    with pytest.raises(SystemExit) as end:
        main([what, *mistake])
    assert end.value.code == 2
    told = capsys.readouterr().err.splitlines()
    assert len(told) == 1 and told[0].startswith("error: ")


def test_worlds_that_cannot_start_are_told_in_one_line(capsys):
    with pytest.raises(SystemExit) as end:
        main(["tasks", "--scenario", "skirmish", "--episodes", "2", "--set", "landscape.levels=[1,1,1]"])
    assert end.value.code == 2
    told = capsys.readouterr().err
    assert told == "error: landscape: a map has no tree that can burn, so there is no fire to start\n"


@pytest.mark.slow
def test_the_tick_is_compiled_too(capsys):
    assert "\ncompiled " in output(capsys, "tick", *TINY)


@pytest.mark.slow
def test_the_environment_is_compiled_too(capsys):
    out = output(capsys, "env", *TINY)
    assert "\nenvironment " in out and "\ncompiled " in out and "\nnumpy, PettingZoo " in out


def test_environment_and_training_are_measured_by_default(capsys):
    out = output(capsys, "--no-compile", *TINY)
    assert "\nenvironment " in out and "\ntraining " in out
    assert "\nnumpy, PettingZoo " in out and "x peer" in out
    for part in ("collecting", "  environment", "  policy", "sampling", "loss", "backward", "optimiser"):
        assert f"\n{part} " in out


@pytest.mark.parametrize("installed", [True, False])
def test_training_is_compared_with_stable_baselines(capsys, monkeypatch, installed):
    if installed:
        pytest.importorskip("supersuit")
        pytest.importorskip("stable_baselines3")
    else:
        monkeypatch.setattr(stable_baselines, "find_spec", lambda name: None)
    small = ["landscape.size=12", "horizon=6", "collector.steps=4", "algorithm.epochs=1"]
    out = output(capsys, "train", "--experiment", "speed_sb3", "--worlds", "2", "--repeats", "1", "--set", *small)
    assert "training" in out and "12 x 12" in out
    if installed:
        assert "\nSuperSuit + SB3 PPO " in out and "x peer" in out
    else:
        assert "SuperSuit + SB3 PPO was skipped: supersuit and stable_baselines3 not installed" in out


def test_growth_is_shown_and_drawn(capsys, tmp_path, monkeypatch):
    pytest.importorskip("matplotlib")
    monkeypatch.setattr(scaling, "AGENT_COUNTS", (1, 3))
    monkeypatch.setattr(scaling, "MAP_SIDES", (12, 16))
    path = tmp_path / "growth.png"
    out = output(capsys, "scaling", *TINY, "--plot", str(path))
    varied = [line.split()[0] for line in out.splitlines() if line.startswith(("worlds", "agents", "cells"))]
    assert varied == ["worlds", "worlds", "agents", "agents", "cells", "cells"] and "KiB a world" in out
    assert path.read_bytes().startswith(b"\x89PNG")


def test_everything_is_printed_as_json(capsys):
    out = output(capsys, "tick", "env", "train", "tasks", "--episodes", "2", "--no-compile", "--json", *TINY)
    content = json.loads(out)
    assert {"processor", "cores", "threads", "python", "torch", "torchrl", "tensordict", "numpy"} <= set(
        content["machine"]
    )
    for section, measure in (
        ("tick", "ns_per_cell"),
        ("env", "agent_steps_per_second"),
        ("train", "agent_steps_per_second"),
    ):
        for row in content[section]:
            assert row["lowest"] <= row[measure] <= row["highest"], section
    assert content["tasks"][0]["scenario"] == "spread_skirmish" and content["peak_memory_gib"] > 0.0
    shares = [row["share"] for row in content["profile"] if row["of"] is None]
    assert sum(shares) == pytest.approx(1.0)


def test_nothing_of_the_stopwatch_stays(tmp_path):
    plan = run_config(plain(compose_config("train", ["n_worlds=2", "collector.steps=4"])))
    training = Training(plan, SavedConfig(), tmp_path)
    learner = training.learner
    owners = (training.env, learner, learner.explore, learner.loss, learner.optimizer, torch.nn.utils)
    before = [{name: id(value) for name, value in vars(owner).items()} for owner in owners]
    rows = training_shares(training, training.batches(), 1)
    training.close()
    assert all(row["seconds"] > 0.0 for row in rows)
    for owner, old in zip(owners, before, strict=True):
        for name in ("step_and_maybe_reset", "forward", "store", "samples", "step", "clip_grad_norm_"):
            assert id(vars(owner).get(name)) == old.get(name, id(None)), name


LAWS = [
    ["fire=paper"],
    ["fire=paper", "wind=paper", "landscape.relief=200", "fire.burning_stages=5"],
    ["fire=spread", "wind.speed=12", "fire.diagonal=unit"],
    ["fire=spread", "fire.neighbours=4"],
]


@pytest.mark.parametrize("overrides", LAWS)
def test_the_numpy_world_plays_the_same_law(overrides):
    env = make_env(
        "default", n_worlds=3, seed=7, overrides=["landscape.size=[12,17]", "ignition.head_start=4", *overrides]
    )
    env.reset()
    world, state = env.world, env.world_state
    # Cells of all codes at random, and some that are wet.
    rng = np.random.default_rng(0)
    random = rng.integers(0, 16, state.cells.shape, dtype=np.uint8) * (state.cover != 0).numpy()
    state = state.replace(
        cells=torch.from_numpy(random), wet=torch.from_numpy(rng.integers(0, 2, random.shape, dtype=np.uint8))
    )
    chance = world.fire.ignition_probability(state)
    u = uniform(state.key, state.tick, Stream.FIRE, world.size)
    after = world.fire.tick(state, u, torch.ones_like(state.done))
    assert chance.max() > 0.5
    for index in range(3):
        peer = numpy_copy(state, index, world.fire, world.side_of_cell)
        np.testing.assert_allclose(peer.on_map(peer.chance_to_ignite()), chance[index], rtol=0.0, atol=1e-6)
        assert (u[index] - chance[index]).abs().min() > 1e-6, "a draw too near to its chance to compare"
        peer.tick(np.pad(u[index].numpy(), 1).ravel())
        for name in ("cells", "age", "burned", "wet"):
            np.testing.assert_array_equal(peer.on_map(getattr(peer, name)), getattr(after, name)[index], err_msg=name)


def test_the_numpy_team_plays_and_earns_the_same():
    overrides = ["landscape.size=14", "team.n_agents=6", "observation=paper", "reward.team_share=1"]
    env = make_env("spread_large", n_worlds=1, seed=3, overrides=overrides)
    now, state = env.reset(), env.world_state
    peer = numpy_copy(state, 0, env.world.fire, env.world.side_of_cell)
    team = NumpyTeam(peer, state.cover[0].numpy(), state.vehicles.position[0].numpy(), 3, env.reward_function)
    generator = torch.Generator().manual_seed(0)
    for _ in range(120):
        # Half of what they do is to extinguish or to clear; now and then all do the same at one place.
        action = torch.randint(0, 14, (1, 6), generator=generator)
        action = torch.where(action > Action.STAY, Action.EXTINGUISH, action)
        u = uniform(state.key, state.tick, Stream.FIRE, env.world.size)[0].numpy()
        now = env.step(now.set(("agents", "action"), action))["next"]
        acts = team.act(action[0].numpy())
        if int(env.world_state.tick) > int(state.tick):
            peer.tick(np.pad(u, 1).ravel())
        state = env.world_state
        np.testing.assert_array_equal(peer.on_map(peer.cells), state.cells[0])
        np.testing.assert_array_equal(np.stack(team.places, axis=1), state.vehicles.position[0])
        np.testing.assert_allclose(team.observe(), now["agents", "observation"][0], atol=0.02)  # ours are bytes
        reward = team.earn(acts, not peer.is_alight)
        np.testing.assert_allclose(reward, now["agents", "reward"][0, :, 0], atol=2e-5)
        if bool(state.done[0]):
            break
    counts = env.tree_counts
    assert peer.counts() == (counts.preserved, counts.extinguished, counts.cleared, counts.burned)
    assert counts.extinguished > 0 and counts.cleared > 0 and counts.burned > 0


def test_the_numpy_environment_keeps_pettingzoos_interface():
    parallel_api_test(NumpyFireEnv(size=(12, 12), horizon=20, seed=0), num_cycles=50)


def test_numpy_terrain_has_the_covers_shares():
    rng = np.random.default_rng(0)
    cover, age = new_ground(rng, (48, 64))
    np.testing.assert_allclose(np.bincount(cover.ravel()) / cover.size, [0.06, 0.10, 0.20, 0.64], atol=0.002)
    assert (age[cover == 0] == 0).all() and np.bincount(age[cover > 0])[[0, 10]].sum() < 0.15 * age.size
    assert np.abs(np.diff(cover.astype(int), axis=1)).mean() < 0.6, "neighbours are alike"


def test_it_calibrates_tasks(capsys):
    out = output(capsys, "tasks", "--episodes", "3", *TINY)
    assert "| spread_skirmish |" in out and "torchrl" in out


def test_it_pairs_the_last_heuristic_with_the_others(capsys):
    asked = ["tasks", "--policies", "noop", "coordinated", "--episodes", "3", *TINY]
    assert "| scenario | fires | noop | coordinated | coordinated - noop | noop [s] |" in output(capsys, *asked)
    row = json.loads(output(capsys, *asked, "--json"))["pairs"][0]
    gap = row["coordinated"]["mean"] - row["noop"]["mean"]
    assert row["differences"]["noop"]["saved_difference"] == pytest.approx(gap) and gap > 0.0
    assert set(row["differences"]) == {"noop"} and min(row["seconds"].values()) > 0.0


@pytest.mark.slow
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


@pytest.mark.slow
def test_fires_of_every_law_are_timed(capsys):
    main(["fires", "--fires", "2", "--json"])
    rows = json.loads(capsys.readouterr().out)["fires"]
    assert [row["law"] for row in rows] == ["paper", "spread", "hazard", "rate"]
    assert all(float(row["seconds"]) > 0.0 and 0 < int(row["burned %"]) <= 100 for row in rows)


@pytest.mark.slow
def test_ellipses_are_compared_with_what_is_told(capsys):
    main(["ellipses", "--reach", "20"])
    table = [line.split() for line in capsys.readouterr().out.splitlines() if line[:3] in ("1.0", "2.3", "4.6")]
    assert len(table) == 30
    assert all(abs(float(row[3])) < 25.0 and abs(float(row[4])) < 25.0 for row in table)
    assert max(abs(float(row[3])) for row in table if row[0] == "1.0") < 8.0


@pytest.mark.parametrize(
    ("vectors", "half", "told"), [("AVX2", False, "(AVX2)"), ("AVX512", True, "(AVX512, bfloat16)")]
)
def test_the_header_tells_the_kind_of_processor(capsys, monkeypatch, vectors, half, told):
    monkeypatch.setattr(machine, "vectors", lambda: vectors)
    monkeypatch.setattr(machine, "computes_in_half", lambda device: half)
    assert told in output(capsys, "tick", "--no-compile", *TINY).splitlines()[0]


def test_what_is_not_compiled_is_told(capsys, monkeypatch):
    monkeypatch.setattr("warp_torchrl.world.eager.vectors", lambda: "AVX2")
    monkeypatch.setattr("warp_torchrl.world.eager.FEW_CELLS", 1)
    out = output(capsys, "env", *TINY)
    assert "\ncompiled was skipped: a step of 512 cells is faster eager with AVX2" in out


def test_repeats_of_the_environment_hold_whole_episodes():
    env = make_env("skirmish", n_worlds=3, overrides=["horizon=30", "landscape.size=12"])
    play = environments.whole_episodes(env)
    before = env.state_dict()["episodes"]
    assert (before >= 2).all(), "every world has started again"
    steps = play()
    assert (env.state_dict()["episodes"] > before).any()
    assert steps == 3 * 30, "as many as the longest episode has"


def test_the_peer_plays_its_episodes_to_their_end():
    peer = NumpyFireEnv(size=(12, 12), horizon=7, seed=0)
    assert environments._random_numpy_play(peer)(3) <= 3 * 7
    assert not peer.agents


def test_rates_are_means_over_all_repeats():
    assert mean_rate("rate", [100, 100], [1.0, 4.0]) == {"rate": 40.0, "lowest": 25.0, "highest": 100.0}
