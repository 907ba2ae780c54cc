"""Which rewards are compiled with a step."""

from dataclasses import dataclass

from warp_torchrl.env.reward import Adaptive, Collaborative, Coverage, Efficiency, Paper, Reward, Time
from warp_torchrl.env.scene import compiles


@dataclass(frozen=True, kw_only=True)
class Own(Efficiency):
    """A reward of a user's own, which may loop over maps."""


def test_rewards_that_read_counts_and_distances_alone_are_compiled():
    assert [each for each in (Efficiency, Time, Coverage, Collaborative, Adaptive, Paper) if compiles(each())] == [
        Efficiency,
        Time,
        Collaborative,
    ]
    assert compiles(Efficiency(shaping=0.1)) and not compiles(Efficiency(shaping=0.1, potential="exposure"))
    assert not compiles(Reward()) and not compiles(Own())
