"""Rewards: the paper's five conservation rewards, and its award for each act.

A reward is a component: called with a transition it returns [B, A, 1].
"""

from warp_torchrl.reward.base import Reward
from warp_torchrl.reward.conservation import Adaptive, Collaborative, Coverage, Efficiency, Time
from warp_torchrl.reward.paper import Paper

__all__ = ["Adaptive", "Collaborative", "Coverage", "Efficiency", "Paper", "Reward", "Time"]
