"""The environment: batched worlds behind TorchRL's ``EnvBase``."""

from warp_torchrl.env.groups import GroupedEnv
from warp_torchrl.env.levels import LeveledEnv
from warp_torchrl.env.wildfire import WildfireEnv

__all__ = ["GroupedEnv", "LeveledEnv", "WildfireEnv"]
