"""What a recording says of an episode."""

import pytest
import torch

from warp_torchrl.demonstrations.recording import MOVER, PROPOSED, Mover
from warp_torchrl.live.crew import Refused
from warp_torchrl.models import ACTION


def test_it_tells_whose_each_action_was(recording):
    movers = recording.steps[MOVER]
    assert movers.shape == (12, 3) and movers.dtype == torch.uint8
    assert set(movers[:, 0].tolist()) <= {Mover.PERSON, Mover.WAITING}
    assert movers[[0, 3, 6, 9], 0].tolist() == [Mover.WAITING] * 4, "no key was pressed in these"
    assert (movers[:, 1] == Mover.ORDER).all() and (movers[:, 2] == Mover.POLICY).all()


def test_corrections_are_the_person_s_acts_that_the_policy_had_not_proposed(recording):
    corrected = recording.corrected()
    assert not corrected[:, 1:].any() and corrected[:, 0].any()
    person = recording.by(Mover.PERSON)
    agreed = person & ~corrected
    assert (recording.steps[ACTION][agreed] == recording.steps[PROPOSED][agreed]).all()


def test_it_has_torchrl_s_entries_and_numbers_what_people_did_to_the_world(recording):
    assert recording.steps.batch_size == (12,)
    assert recording.steps["next", "agents", "reward"].shape == (12, 3, 1)
    assert recording.steps["next", "done"].shape == (12, 1)
    assert [(each.step, each.kind) for each in recording.events] == [(2, "clear"), (3, "blow"), (4, "ignite")]
    assert recording.policy == "coordinated" and recording.frames is None
    assert recording.agents == ("bulldozer_0", "bulldozer_1", "bulldozer_2")


def test_a_forbidden_act_is_nobody_s(match):
    side = match.sides[0]
    match.restart()
    side.crew.hand_back(0, 1)
    side.crew.ask_before(side.env.action_names)
    for question in match.questions():
        side.crew.answer(question, allow=False)
    match.step()
    movers = side.record().steps[MOVER][0]
    assert (movers == Mover.FORBIDDEN).all()


def test_nothing_is_no_recording(match):
    match.restart()
    with pytest.raises(Refused, match="nothing was played yet"):
        match.sides[0].record()


def test_a_tape_counts_what_people_do(match, recording):
    open_recording = match.sides[0].open_recording
    assert open_recording.acts == int(recording.by(Mover.PERSON).sum()) > 0
    assert open_recording.corrections == int(recording.corrected().sum()) > 0
    assert open_recording.words == int(recording.by(Mover.ORDER).sum()) == 12 and open_recording.has_people
    match.restart()
    match.sides[0].crew.hand_back(0, 1)
    match.sides[0].order(1, None)
    match.step()
    assert not match.sides[0].open_recording.has_people, "it is the policy's alone"
    match.blow(3.0, 0.0)
    assert match.sides[0].open_recording.has_people


def test_it_tells_what_was_saved_where_it_was_left(match, recording):
    assert recording.saved == match.sides[0].curves.saved[-1] < 1.0
