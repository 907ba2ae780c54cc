"""When a run saves, told by a clock that the tests set."""

from itertools import pairwise

import pytest
import torch

from tests.training.test_loop import LAST, RUNS, TINIER, flattened, rows, tiny, without_times
from warp_torchrl.runs.checkpoint import newest
from warp_torchrl.runs.saving import MOST_TIME_SHARE, SaveClock, passes


class Time:
    """A clock that stands until it is moved."""

    def __init__(self):
        self.seconds = 1000.0

    def __call__(self):
        return self.seconds


def played(seconds, cost, minutes=2.0, step=1.0):
    """The moments of the saves of a run of so many seconds whose saves take ``cost(moment)``, and the clock."""
    time, moments = Time(), []
    start = time.seconds
    clock = SaveClock(minutes, lambda: int(1e6 * cost(time.seconds - start)), time)  # a second for each megabyte
    while time.seconds - start < seconds:
        time.seconds += step
        if clock.is_due():
            moments.append(time.seconds - start)
            with clock.timed():
                time.seconds += cost(moments[-1])
    return moments, clock


def test_the_first_save_comes_with_the_first_batch_and_the_others_by_the_minutes():
    moments, clock = played(600.0, cost=lambda moment: 0.05)
    assert moments[0] == 1.0 and len(moments) == clock.saves == 5
    assert all(120.0 <= after - before < 122.0 for before, after in pairwise(moments))


def test_a_clock_of_no_minutes_never_asks():
    assert played(10_000.0, cost=lambda moment: 0.0, minutes=0.0)[0] == []


@pytest.mark.parametrize("took", [0.2, 3.0, 40.0])
def test_saves_take_a_hundredth_of_the_time_however_long_one_takes(took):
    moments, clock = played(1_000_000.0, cost=lambda moment: took, step=10.0)
    assert clock.share() <= MOST_TIME_SHARE and len(moments) > 200
    assert all(after - before >= 99.0 * took - 10.0 for before, after in pairwise(moments))


def test_a_save_of_a_memory_that_has_grown_is_foreseen():
    """The memory is full after 400 s, and a save takes 8 s from then on: the second one waits for some 800 s."""
    moments, clock = played(20_000.0, cost=lambda moment: 8.0 * min(1.0, moment / 400.0))
    assert moments[0] == 1.0 and 780.0 <= moments[1] <= 805.0
    assert all(after - before >= 99.0 * 8.0 for before, after in pairwise(moments[1:]))
    assert clock.share() <= MOST_TIME_SHARE and len(moments) > 20


@pytest.mark.parametrize(("interval", "frames", "batch", "expected"), [
    (64, 64, 32, True), (64, 96, 32, False), (64, 96, 48, True), (64, 144, 48, True), (10**6, 32, 32, False),
])  # fmt: skip
def test_an_interval_is_passed_by_the_batch_that_reaches_its_multiple(interval, frames, batch, expected):
    assert passes(interval, frames, batch) is expected


@pytest.mark.parametrize(
    "name",
    [pytest.param("mappo", marks=pytest.mark.slow), pytest.param("dqn", marks=pytest.mark.slow), "all that moves"],
)
def test_saves_by_the_clock_change_nothing(tmp_path, name):
    """A run that saves whenever it can ends as one that never does, and so does one that goes on from such a save."""
    own = [*TINIER, *RUNS[name], "checkpoint.interval=1000000", "checkpoint.keep=2"]
    for folder in ("never", "often"):
        (tmp_path / folder).mkdir()
    never = tiny(tmp_path / "never", *own)
    never.train()
    often = tiny(tmp_path / "often", *own)
    often.clock = SaveClock(1.0, often._size, time := Time())
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
    assert sorted(int(each.name) for each in (tmp_path / "often" / "checkpoints").iterdir()) == [
        16 * (LAST - 2),
        16 * (LAST - 1),
    ]
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
    run = tiny(tmp_path, *TINIER, "total_frames=96", "checkpoint.interval=32", "checkpoint.keep=4")
    run.clock = SaveClock(1.0, run._size, time := Time())
    learn = run._learn

    def slowly(batch):
        time.seconds += 61.0
        return learn(batch)

    run._learn = slowly
    run.train()
    assert sorted(int(each.name) for each in (tmp_path / "checkpoints").iterdir()) == [32, 64, 80, 96]


def test_what_a_save_writes_is_what_a_replay_memory_holds_and_not_its_room(tmp_path):
    run = tiny(tmp_path, *TINIER, *RUNS["dqn"], "algorithm.capacity=4000")
    run._learn([next(iter(run.collection))])
    whole = run.learner.keeps["replay"].buffer._storage._storage
    room = sum(each.nbytes for each in whole.values(True, True))
    written = (run.save() / "training.pt").stat().st_size
    assert 16 / 4000 * room < run._size() < written < 0.2 * room
