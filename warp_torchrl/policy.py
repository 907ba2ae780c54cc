"""A trained policy, as it is handed to users."""

from contextlib import nullcontext

from tensordict import TensorDictBase
from tensordict.nn import TensorDictModuleBase
from torchrl.envs.utils import exploration_type, set_exploration_type

from warp_torchrl.evaluation import MODES


class TrainedPolicy(TensorDictModuleBase):
    """A decentralised policy that acts as it was found to act best, unless TorchRL's exploration type is set.

    Args:
        module: Observation and mask in, action out.
        mode: ``sampled`` or ``deterministic``.
    """

    def __init__(self, module: TensorDictModuleBase, mode: str) -> None:
        super().__init__()
        self.in_keys, self.out_keys = module.in_keys, module.out_keys
        self.module, self.mode = module, mode

    def forward(self, tensordict: TensorDictBase) -> TensorDictBase:
        """Write the team's actions, int64 [B, A]."""
        own = set_exploration_type(MODES[self.mode]) if exploration_type() is None else nullcontext()
        with own:
            return self.module(tensordict)
