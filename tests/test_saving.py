"""When a run saves, told by a clock that the tests set."""

from itertools import pairwise

import pytest
import torch

from tests.test_training import LAST, RUNS, TINIER, flattened, rows, tiny, without_times
from warp_torchrl.checkpoint import newest
from warp_torchrl.saving import FIRST, SHARE, SaveClock, passes


class Time:
    """A clock that stands until it is moved."""

    def __init__(self):
        self.seconds = 1000.0

    def __call__(self):
        return self.seconds


def played(seconds, cost, minutes=2.0, step=1.0):
    """The moments of the saves of a run of so many seconds whose saves take ``cost(moment)``, and the clock."""
    time, moments = Time(), []
    clock, start = SaveClock(minutes, time), time.seconds
    while time.seconds - start < seconds:
        time.seconds += step
        if clock.is_due():
            moments.append(time.seconds - start)
            with clock.timed():
                time.seconds += cost(moments[-1])
    return moments, clock


def test_the_first_save_is_soon_and_the_others_by_the_minutes():
    moments, clock = played(600.0, cost=lambda moment: 0.05)
    assert moments[0] == FIRST and len(moments) == clock.saves == 5
    assert all(120.0 <= after - before < 122.0 for before, after in pairwise(moments))


def test_a_clock_of_no_minutes_never_asks():
    assert played(10_000.0, cost=lambda moment: 0.0, minutes=0.0)[0] == []


def test_less_than_the_first_wait_is_a_wait_too():
    assert played(10.5, cost=lambda moment: 0.0, minutes=1 / 60)[0] == [float(each) for each in range(1, 12)]


@pytest.mark.parametrize("took", [0.2, 3.0, 40.0])
def test_saves_take_a_hundredth_of_the_time_however_long_one_takes(took):
    moments, clock = played(1_000_000.0, cost=lambda moment: took, step=10.0)
    assert clock.share() <= SHARE and len(moments) > 200
    assert all(after - before >= 99.0 * took - 10.0 for before, after in pairwise(moments))


def test_saves_that_grow_with_a_replay_memory_are_waited_out():
    """The memory is full after 400 s, and a save takes 8 s from then on: growth is paid for by later waits."""
    moments, clock = played(20_000.0, cost=lambda moment: 8.0 * min(1.0, moment / 400.0))
    assert moments[0] == FIRST and clock.share() <= SHARE and len(moments) > 15


@pytest.mark.parametrize(("interval", "frames", "batch", "expected"), [
    (64, 64, 32, True), (64, 96, 32, False), (64, 96, 48, True), (64, 144, 48, True), (10**6, 32, 32, False),
])  # fmt: skip
def test_an_interval_is_passed_by_the_batch_that_reaches_its_multiple(interval, frames, batch, expected):
    assert passes(interval, frames, batch) is expected


@pytest.mark.parametrize("name", ["mappo", "dqn", "all that moves"])
def test_saves_by_the_clock_change_nothing(tmp_path, name):
    """A run that saves whenever it can ends as one that never does, and so does one that goes on from such a save."""
    own = [*TINIER, *RUNS[name], "checkpoint.interval=1000000", "checkpoint.keep=2"]
    for folder in ("never", "often"):
        (tmp_path / folder).mkdir()
    never = tiny(tmp_path / "never", *own)
    never.train()
    often = tiny(tmp_path / "often", *own)
    often.clock = SaveClock(1.0, time := Time())
    learn = often._learn

    def slowly(batch):
        time.seconds += 61.0
        if often.frames == 16 * (LAST - 1):
            raise KeyboardInterrupt
        return learn(batch)

    often._learn = slowly
    with pytest.raises(KeyboardInterrupt):
        often.train()
    assert often.clock.saves == LAST - 1
    assert sorted(int(each.name) for each in (tmp_path / "often" / "checkpoints").iterdir()) == [64, 80]
    resumed = tiny(tmp_path / "often", *own)
    resumed.load_state_dict(newest(tmp_path / "often")[0].training())
    resumed.train()
    ours, theirs = flattened(resumed.state_dict()), flattened(never.state_dict())
    assert set(ours) == set(theirs)
    for key in set(theirs) - {"/seconds"}:
        is_tensor = isinstance(theirs[key], torch.Tensor)
        assert torch.equal(ours[key], theirs[key]) if is_tensor else ours[key] == theirs[key], key
    assert without_times(rows(tmp_path / "often")) == without_times(rows(tmp_path / "never"))


def test_the_interval_s_checkpoints_are_the_same_whatever_the_clock_does(tmp_path):
    run = tiny(tmp_path, *TINIER, "checkpoint.interval=32", "checkpoint.keep=4")
    run.clock = SaveClock(1.0, time := Time())
    learn = run._learn

    def slowly(batch):
        time.seconds += 61.0
        return learn(batch)

    run._learn = slowly
    run.train()
    assert sorted(int(each.name) for each in (tmp_path / "checkpoints").iterdir()) == [32, 64, 80, 96]
