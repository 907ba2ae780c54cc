"""Policies by name, as evaluations play them."""

import pytest
import torch

from warp_torchrl.evaluation.play import play
from warp_torchrl.live.match import Match, Setting
from warp_torchrl.live.player import player_of
from warp_torchrl.models import ACTION
from warp_torchrl.runs.config.construction import ConfigError
from warp_torchrl.runs.policies.named_policy import NamedPolicy


@pytest.mark.parametrize("name", ["skirmish", "local", pytest.param("random", marks=pytest.mark.slow)])
def test_a_match_is_what_an_evaluation_of_its_seed_plays(name):
    match = Match(Setting(policy=name, seed=1_000_005, overrides=("landscape.size=16", "horizon=40")))
    while not match.ended:
        match.step()
    side = match.sides[0]
    found = play(match_env(match), side.player.policy if name == "skirmish" else again(match), 1_000_005, mode(side))
    assert side.curves.saved[-1] == pytest.approx(float(found["saved"][0]), abs=1e-7)
    assert int(side.curves.extinguished.sum()) > 0 and side.curves.saved[-1] > match.alone.curves.saved[-1]


def match_env(match):
    match.sides[0].env.watcher = None
    return match.sides[0].env


def again(match):
    return player_of(NamedPolicy(match.sides[0].player.name), match.sides[0].env, 0).policy


def mode(side):
    return side.player.mode


def test_a_sampled_policy_draws_the_same_again_and_leaves_the_draws_of_others(make_match):
    match = make_match("skirmish")
    match.sides[0].player.mode = "sampled"
    torch.manual_seed(3)
    before = torch.get_rng_state()
    first = [_step(match) for _ in range(8)]
    assert torch.get_rng_state().equal(before)
    match.restart()
    torch.manual_seed(4)  # the draws of others
    assert [_step(match) for _ in range(8)] == first
    match.restart(match.setting.seed + 1)
    assert [_step(match) for _ in range(8)] != first


def _step(match):
    match.step()
    return match.sides[0].state.vehicles.last_action[0].tolist()


def test_probabilities_add_up_to_one_under_the_mask_and_a_deterministic_policy_takes_the_largest(make_match):
    side = make_match("default").sides[0]
    side.player.mode = "deterministic"
    action, chances = side.player.act(side.shown)
    assert torch.allclose(chances.sum(-1), torch.ones(3)) and not chances[~side.mask].any()
    assert action.equal(chances.argmax(-1))
    assert side.player.act(side.shown)[0].equal(side.player.policy(side.shown.copy())[ACTION][0])


def test_a_policy_that_does_not_fit_is_told_with_what_is_missing(make_match):
    with pytest.raises(ConfigError, match=r"the policy skirmish does not fit here: .*stay"):
        make_match("skirmish", ("team.allow_stay=false",))


def test_a_baseline_has_no_probabilities(make_match):
    side = make_match("greedy").sides[0]
    assert side.player.act(side.shown)[1] is None and side.player.frames is None


def test_a_run_that_goes_on_is_followed_to_its_newest_checkpoint(run_folder, make_match):
    run, add = run_folder
    match = make_match(str(run))
    player = match.sides[0].player
    assert player.frames == 1000 and match.follow() == []
    add(2000)
    before = player.policy
    assert match.follow() == [f"{run} plays its newest weights, of 2,000 steps"]
    assert player.frames == 2000 and player.policy is not before
    assert match.follow() == []


def test_an_unsound_newer_checkpoint_leaves_the_weights(run_folder, make_match):
    run, add = run_folder
    match = make_match(str(run))
    (add(2000) / "policy.pt").write_bytes(b"broken")
    assert match.follow() == [] and match.sides[0].player.frames == 1000


def test_a_run_whose_folder_is_taken_away_goes_on_with_a_line(run_folder, make_match):
    run, _ = run_folder
    match = make_match(str(run))
    (run / "checkpoints" / "1000" / "manifest.json").unlink()
    (line,) = match.follow()
    assert "keeps its weights" in line
    match.step()


def test_a_shipped_policy_is_not_looked_after(make_match):
    assert make_match("skirmish").follow() == []
