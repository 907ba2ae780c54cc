"""A scripted person corrects a policy, and what they did is recorded, replayed and learned from."""

import re

import pytest
import torch

from warp_torchrl.config.compose import compose_config, plain, without_targets
from warp_torchrl.config.run_config import run_config
from warp_torchrl.config.saved_config import SavedConfig
from warp_torchrl.config.seeds import first_world_seed
from warp_torchrl.correct import Correction, Session, main, read
from warp_torchrl.demonstrations.files import find
from warp_torchrl.demonstrations.files import read as read_recording
from warp_torchrl.demonstrations.recording import MOVER, PROPOSED, Mover
from warp_torchrl.demonstrations.replay import Replay
from warp_torchrl.demonstrations.scripted import Person
from warp_torchrl.heuristics import HEURISTICS
from warp_torchrl.models import ACTION, ACTION_MASK
from warp_torchrl.runs.checkpoint import newest
from warp_torchrl.training.loop import Training


@pytest.fixture(scope="module")
def run(tmp_path_factory):
    """A run of two agents that has hardly learned."""
    folder = tmp_path_factory.mktemp("weak")
    overrides = ["landscape.size=12", "horizon=16", "n_worlds=4", "collector.steps=8", "total_frames=32"]
    small = [
        "algorithm.minibatch_size=32",
        "model.actor_hidden=[8]",
        "model.critic_hidden=[8]",
        "evaluation.mode=sampled",
    ]
    config = compose_config("train", [*overrides, *small])
    values = {k: v for k, v in without_targets(plain(config)).items() if k not in ("resume", "debug")}
    choices = {"algorithm": "mappo", "reward": "efficiency", "observation": "surroundings", "scenario": "skirmish"}
    Training(run_config(plain(config)), SavedConfig(choices=choices, values=values), folder).train()
    return folder


def corrected(run, person=None, **session):
    found = Correction(Session(policy=str(run), out="nowhere", **{"episodes": 3, **session}), person or Person())
    return found, list(found.episodes())


ALWAYS = Person(delay=0, error=0.0, threshold=1.0)


def test_the_person_s_acts_are_the_baseline_s_of_so_many_steps_ago(run):
    """Held against the baseline in a replay of what was recorded, which draws nothing."""
    for delay in (0, 2):
        person = Person(delay=delay, error=0.0, threshold=1.0, by="coordinated")
        for played in corrected(run, person)[1]:
            replay, recording = Replay(played.recording), played.recording
            baseline, advice = HEURISTICS["coordinated"](replay.env), []
            for step, state in enumerate(replay.states()):
                if step < len(recording.steps):
                    advice.append(baseline.choose(state, recording.steps[ACTION_MASK][step][None])[0])
            movers, actions = recording.steps[MOVER], recording.steps[ACTION]
            driven = int((movers != Mover.POLICY).any(0).nonzero()[0])
            assert (movers[:, 1 - driven] == Mover.POLICY).all(), "they have one keyboard"
            by_person = recording.by(Mover.PERSON)[:, driven]
            assert (movers[:delay, driven] == Mover.WAITING).all() and by_person.any()
            for step in by_person.nonzero()[:, 0].tolist():
                assert int(actions[step, driven]) == int(advice[step - delay][driven])


def test_the_policy_s_own_acts_are_its_proposals(run):
    for played in corrected(run, Person(threshold=0.3))[1]:
        own = played.recording.by(Mover.POLICY)
        steps = played.recording.steps
        assert own.any() and torch.equal(steps[ACTION][own], steps[PROPOSED][own])


def test_a_person_who_is_never_needed_leaves_the_policy_alone(run):
    for played in corrected(run, Person(threshold=0.0))[1]:
        assert played.recording.by(Mover.POLICY).all() and not played.recording.corrected().any()


def test_the_same_seed_gives_the_same_recordings(run):
    first, again, other = (corrected(run, seed=seed)[1] for seed in (3, 3, 4))
    for one, two in zip(first, again, strict=True):
        assert one.recording.seed == two.recording.seed and (one.recording.steps == two.recording.steps).all()
        assert (one.saved, one.saved_alone) == (two.saved, two.saved_alone)
    assert [each.recording.seed for each in first] == [first_world_seed(3) + episode for episode in range(3)]
    assert not {each.recording.seed for each in first} & {each.recording.seed for each in other}


def test_episodes_end_with_the_one_in_which_the_acts_are_reached(run):
    acts = [int(each.recording.by(Mover.PERSON).sum()) for each in corrected(run, ALWAYS)[1]]
    assert len(corrected(run, ALWAYS, acts=acts[0])[1]) == 1
    assert len(corrected(run, ALWAYS, acts=acts[0] + 1)[1]) == 2


def test_a_recording_ends_with_its_own_episode_whatever_the_others_do(run):
    played = [each.recording.steps for each in corrected(run, ALWAYS, episodes=6, overrides=("horizon=60",))[1]]
    assert len({len(steps) for steps in played}) > 1, "these fires end at different steps"
    for steps in played:
        assert steps["next", "done"][-1].all() and not steps["next", "done"][:-1].any()


def test_more_episodes_than_are_played_abreast(run, monkeypatch):
    whole = corrected(run, ALWAYS)[1]
    monkeypatch.setattr("warp_torchrl.correct._ABREAST", 2)
    parts = corrected(run, ALWAYS)[1]
    assert [each.recording.seed for each in parts] == [each.recording.seed for each in whole]
    assert (parts[0].recording.steps[MOVER] == whole[0].recording.steps[MOVER]).all()


def test_the_command_writes_recordings_that_replay_and_prints_a_table(run, tmp_path, capsys):
    assert main([f"policy={run}", f"out={tmp_path / 'people'}", "episodes=2", "threshold=1", "delay=0"]) == 0
    row = capsys.readouterr().out.splitlines()[-1]
    recordings = [read_recording(path) for path in find(tmp_path / "people")]
    for each in recordings:
        Replay(each).check()
        assert each.frames == newest(run)[0].manifest.frames and each.policy == str(run)
    acts, steps = (
        sum(int(each.by(Mover.PERSON).sum()) for each in recordings),
        sum(len(each.steps) for each in recordings),
    )
    found = re.fullmatch(r"\| skirmish \| 2 \| (\d+) \| (\d+) \| (\d+) \| (\d+\.\d) \| (\d+\.\d) \|", row)
    assert found and [int(each) for each in found.groups()[:2]] == [steps, acts] and 0 < int(found[3]) <= acts
    assert main([f"policy={run}", f"out={tmp_path / 'people'}"]) == 2
    assert "out must be a new folder" in capsys.readouterr().err


def test_a_policy_with_more_actions_here_than_it_was_trained_with_has_chances_of_its_own(run):
    correction, played = corrected(run, ALWAYS, overrides=("team.roles=[ugv]", "team.tank=3"), episodes=1)
    shown = correction.env.reset()
    chances = correction.policy.probabilities(correction.policy(shown))
    open_to_it = shown[ACTION_MASK].clone()
    assert chances.shape == open_to_it.shape and torch.allclose(chances.sum(-1), torch.ones(1, 2))
    assert not chances[~open_to_it].any() and len(played) == 1


@pytest.mark.parametrize(
    ("arguments", "said"),
    [
        (["policy=coordinated", "out=x"], "policy must be a trained one, which tells how sure it is, got coordinated"),
        (["policy=nobody", "out=x"], "policy must be one of"),
        (["out=x"], "policy must be given"),
        (["policy=default"], "out must be given"),
        (["policy=default", "out=x", "episodes=0"], "episodes must be in"),
        (["policy=default", "out=x", "delay=soon"], "delay must be a whole number"),
        (["policy=default", "out=x", "by=ring"], "by must be one of"),
        (["policy=default", "out=x", "observation=paper"], "the policy default does not fit here"),
        (["policy=default", "out=x", "team.n_agent=3"], "did you mean team.n_agents"),
    ],
)
def test_a_mistake_is_told_in_one_line(arguments, said, capsys, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    assert main(arguments) == 2
    told = capsys.readouterr().err.splitlines()
    assert len(told) == 1 and said in told[0]
    assert not (tmp_path / "x").exists()


def test_every_key_is_read():
    given = ["policy=a", "out=b", "episodes=5", "acts=7", "seed=3", "by=local", "delay=2", "error=0.25", "threshold=1"]
    session, person = read([*given, "team.n_agents=3"])
    assert session == Session(policy="a", out="b", episodes=5, acts=7, seed=3, overrides=("team.n_agents=3",))
    assert person == Person(by="local", delay=2, error=0.25, threshold=1.0)
    assert read(["policy=1", "out=2020-01-01", "acts=null"])[0] == Session(policy="1", out="2020-01-01")


def test_help_names_every_key(capsys):
    assert main(["--help"]) == 0
    told = capsys.readouterr().out
    assert all(f"{key}" in told for key in ("policy", "out", "episodes", "acts", "delay", "error", "threshold", "seed"))
