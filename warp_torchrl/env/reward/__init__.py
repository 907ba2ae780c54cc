"""Rewards: the paper's five conservation rewards, its award for each act, a reward for watching, and one of agencies.

A reward is a component: called with a transition it returns [B, A, 1].
"""

from warp_torchrl.env.reward.agency import Agency
from warp_torchrl.env.reward.base import Reward
from warp_torchrl.env.reward.conservation import Adaptive, Collaborative, Coverage, Efficiency, Time
from warp_torchrl.env.reward.monitor import Monitor
from warp_torchrl.env.reward.paper import Paper

__all__ = ["Adaptive", "Agency", "Collaborative", "Coverage", "Efficiency", "Monitor", "Paper", "Reward", "Time"]
