"""A scripted person corrects a policy."""

import pytest
import torch

from warp_torchrl.commands.correction import Correction, Session
from warp_torchrl.demonstrations.recording import MOVER, PROPOSED, Mover
from warp_torchrl.demonstrations.replay import Replay
from warp_torchrl.demonstrations.scripted import Person
from warp_torchrl.heuristics import HEURISTICS
from warp_torchrl.models import ACTION, ACTION_MASK
from warp_torchrl.runs.config.seeds import first_world_seed


def corrected(weak_run, person=None, **session):
    found = Correction(Session(policy=str(weak_run), out="nowhere", **{"episodes": 3, **session}), person or Person())
    return found, list(found.episodes())


ALWAYS = Person(delay=0, error=0.0, threshold=1.0)


def test_the_person_s_acts_are_the_baseline_s_of_so_many_steps_ago(weak_run):
    """Held against the baseline in a replay of what was recorded, which draws nothing."""
    for delay in (0, 2):
        person = Person(delay=delay, error=0.0, threshold=1.0, by="coordinated")
        for played in corrected(weak_run, person, episodes=2)[1]:
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


def test_the_policy_s_own_acts_are_its_proposals(weak_run):
    for played in corrected(weak_run, Person(threshold=0.3))[1]:
        own = played.recording.by(Mover.POLICY)
        steps = played.recording.steps
        assert own.any() and torch.equal(steps[ACTION][own], steps[PROPOSED][own])


def test_a_person_who_is_never_needed_leaves_the_policy_alone(weak_run):
    for played in corrected(weak_run, Person(threshold=0.0))[1]:
        assert played.recording.by(Mover.POLICY).all() and not played.recording.corrected().any()


@pytest.mark.slow
def test_the_same_seed_gives_the_same_recordings(weak_run):
    first, again, other = (corrected(weak_run, seed=seed)[1] for seed in (3, 3, 4))
    for one, two in zip(first, again, strict=True):
        assert one.recording.seed == two.recording.seed and (one.recording.steps == two.recording.steps).all()
        assert (one.recording.saved, one.saved_alone) == (two.recording.saved, two.saved_alone)
    assert [each.recording.seed for each in first] == [first_world_seed(3) + episode for episode in range(3)]
    assert not {each.recording.seed for each in first} & {each.recording.seed for each in other}


def test_episodes_end_with_the_one_in_which_the_acts_are_reached(weak_run):
    acts = [int(each.recording.by(Mover.PERSON).sum()) for each in corrected(weak_run, ALWAYS)[1]]
    assert len(corrected(weak_run, ALWAYS, acts=acts[0])[1]) == 1
    assert len(corrected(weak_run, ALWAYS, acts=acts[0] + 1)[1]) == 2


@pytest.mark.slow
def test_a_recording_ends_with_its_own_episode_whatever_the_others_do(weak_run):
    played = [each.recording.steps for each in corrected(weak_run, ALWAYS, episodes=6, overrides=("horizon=60",))[1]]
    assert len({len(steps) for steps in played}) > 1, "these fires end at different steps"
    for steps in played:
        assert steps["next", "done"][-1].all() and not steps["next", "done"][:-1].any()


@pytest.mark.slow
def test_more_episodes_than_are_played_abreast(weak_run, monkeypatch):
    whole = corrected(weak_run, ALWAYS)[1]
    monkeypatch.setattr("warp_torchrl.commands.correction._ABREAST", 2)
    parts = corrected(weak_run, ALWAYS)[1]
    assert [each.recording.seed for each in parts] == [each.recording.seed for each in whole]
    assert (parts[0].recording.steps[MOVER] == whole[0].recording.steps[MOVER]).all()


def test_a_policy_with_more_actions_here_than_it_was_trained_with_has_chances_of_its_own(weak_run):
    correction, played = corrected(weak_run, ALWAYS, overrides=("team.roles=[ugv]", "team.tank=3"), episodes=1)
    shown = correction.env.reset()
    chances = correction.policy.probabilities(correction.policy(shown))
    open_to_it = shown[ACTION_MASK].clone()
    assert chances.shape == open_to_it.shape and torch.allclose(chances.sum(-1), torch.ones(1, 2))
    assert not chances[~open_to_it].any() and len(played) == 1
