"""What a training tells of itself."""

from warp_torchrl.progress import line

ROW = {"time/frames": 104, "time/seconds": 3.2, "time/fps": 40.4, "world/saved": None, "rollout/ep_rew_mean": -1.234,
       "train/loss": 0.5}  # fmt: skip


def test_a_line_says_what_there_is_to_say():
    assert line(ROW, 400) == " 26.0 %  104 frames  3 s  40 frames/s  saved -  reward -1.23  loss 0.500"


def test_whole_batches_end_at_a_hundred_per_cent():
    assert line(ROW, 100).startswith("100.0 %  104 frames")
