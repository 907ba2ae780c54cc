"""A recording plays again, exactly."""

from dataclasses import replace

import pytest
import torch

from warp_torchrl.demonstrations.events import Event
from warp_torchrl.demonstrations.files import read_recording, save_recording
from warp_torchrl.demonstrations.replay import Replay
from warp_torchrl.system.checksummed import Unsound
from warp_torchrl.world.state.cells import is_tree


def test_the_worlds_are_those_that_were_played(match, recording, tmp_path):
    last = Replay(read_recording(save_recording(recording, tmp_path))).check()
    for name, value in match.sides[0].state.what_changes().items():
        assert torch.equal(last.what_changes()[name], value), name


def test_it_yields_the_start_and_every_step(recording):
    states = list(Replay(recording).states())
    assert [int(each.step[0]) for each in states] == list(range(13))


@pytest.mark.parametrize("left_out", [0, 1, 2])
def test_without_one_of_the_events_another_episode_is_played(recording, left_out):
    events = tuple(each for at, each in enumerate(recording.events) if at != left_out)
    recording = replace(recording, events=events)
    with pytest.raises(Unsound, match=r"step \d+ of the recording is not what this version plays"):
        Replay(recording).check()


def test_another_action_is_told(recording):
    recording.steps["agents", "action"][5, 2] = (recording.steps["agents", "action"][5, 2] + 4) % 8
    with pytest.raises(Unsound, match="is not what this version plays"):
        Replay(recording).check()


def test_a_configuration_of_another_version_is_told(recording):
    recording.environment.values["nothing"] = {"such": 1}
    with pytest.raises(ValueError, match="nothing"):
        Replay(recording)


def test_it_plays_a_second_time(recording):
    replay = Replay(recording)  # with a held wind, which must not blow at the second start
    assert torch.equal(replay.check().cells, replay.check().cells)


def test_a_wrong_number_of_what_was_saved_is_told(recording):
    object.__setattr__(recording, "saved", recording.saved - 0.01)
    with pytest.raises(Unsound, match="the recording says that"):
        Replay(recording).check()
    object.__setattr__(recording, "saved", None)
    Replay(recording).check()


@pytest.mark.parametrize("key", [("agents", "role"), ("next", "terminated"), ("next", "truncated"), ("next", "done")])
def test_all_that_was_shown_is_compared(recording, key):
    value = recording.steps[key][-1]
    recording.steps[key][-1] = ~value if value.dtype is torch.bool else value + 1
    with pytest.raises(Unsound, match=f"step 11 of the recording is not what this version plays: {key[-1]} differs"):
        Replay(recording).check()


def test_entries_that_are_not_those_of_the_environment_are_told(recording):
    del recording.steps["agents", "observation", "status"]
    with pytest.raises(Unsound, match=r"the recording's observation has other entries than this version's: view$"):
        Replay(recording).check()


def test_numbers_of_another_shape_or_type_are_told(recording):
    recording.steps["agents", "action_mask"] = recording.steps["agents", "action_mask"][..., :1]
    with pytest.raises(Unsound, match="action_mask differs"):
        Replay(recording).check()


@pytest.mark.parametrize(("what", "names"), [("agents", ("a", "b", "c")), ("actions", ("up",))])
def test_names_that_are_not_those_of_the_environment_are_told(recording, what, names):
    with pytest.raises(Unsound, match=f"the recording's {what} are not those of its configuration"):
        Replay(replace(recording, **{what: names}))


def test_an_event_that_cannot_be_is_told(recording):
    for kind, numbers in (("ignite", (99.0, 0.0)), ("blow", (1e9, 0.0))):
        events = (Event(step=0, kind=kind, numbers=numbers),)
        with pytest.raises(Unsound, match="an event of the recording cannot be: "):
            Replay(replace(recording, events=events)).check()


def test_a_map_that_would_fill_the_memory_is_not_played(recording):
    recording.environment.values["landscape"]["size"] = 4096
    with pytest.raises(Unsound, match="has 4096 x 4096 cells, and at most 4194304 are played again"):
        Replay(recording)


def test_what_people_did_after_the_last_step_is_played(match):
    row, column = is_tree(match.sides[0].state.cells[0]).nonzero()[0].tolist()
    match.clear(row, column)
    recording = match.sides[0].record()
    assert recording.events[-1].step == len(recording.steps)
    last = Replay(recording).check()
    assert torch.equal(last.cells, match.sides[0].state.cells)
    forgotten = replace(recording, events=recording.events[:-1])
    assert not torch.equal(Replay(replace(forgotten, saved=None)).check().cells, last.cells)


def test_the_last_digit_of_a_number_may_differ(recording):
    steps = recording.steps.clone()
    steps["next", "agents", "reward"] *= 1.000001
    Replay(replace(recording, steps=steps)).check()
