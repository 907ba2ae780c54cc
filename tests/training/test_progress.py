"""What a training tells of itself."""

import pytest

from warp_torchrl.collection.collectors import InProcess
from warp_torchrl.training.progress import batch_size_notice, line

ROW = {"time/frames": 104, "time/seconds": 3.2, "time/fps": 40.4, "world/saved": None, "rollout/ep_rew_mean": -1.234,
       "train/loss": 0.5}  # fmt: skip


def test_a_line_says_what_there_is_to_say():
    assert line(ROW, 400) == " 26.0 %  104 frames  3 s  40 frames/s  saved -  reward -1.23  loss 0.500"


def test_whole_batches_end_at_a_hundred_per_cent():
    assert line(ROW, 100).startswith("100.0 %  104 frames")


def test_it_is_told_where_whole_batches_are_not_what_was_asked_for():
    assert batch_size_notice(128, 128, 4, 8) is None
    assert batch_size_notice(20, 32, 4, 8) == (
        "total_frames=20 is less than one batch: one batch is 32 frames, n_worlds=4 x collector.steps=8, and one is "
        "trained on"
    )
    assert batch_size_notice(100, 128, 4, 8).endswith(": training ends at 128 frames, not at total_frames=100")
    assert batch_size_notice(100, 128, 4, 4, "first_steps").startswith(
        "one batch is 16 frames, n_worlds=4 x collector.f"
    )


@pytest.mark.parametrize(
    ("total", "grows_at", "end"),
    [(192, 0.5, 192), (190, 0.5, 192), (200, 0.5, 208), (192, 0.0, 192), (200, 0.0, 224), (10, 0.5, 16)],
)
def test_a_training_ends_with_a_whole_batch(total, grows_at, end):
    # Four worlds: batches of 16 frames up to the half, then of 32.
    assert InProcess(steps=8, grows_at=grows_at).end(total, 4) == end


def test_first_batches_have_half_of_the_steps_unless_told():
    assert [InProcess(steps=steps).segment for steps in (32, 7, 1)] == [16, 7, 1]
    assert InProcess(steps=32, first_steps=8).segment == 8
    assert InProcess(steps=32, first_steps=8, grows_at=0.0).segment == 32
