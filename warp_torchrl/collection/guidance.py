"""Exploration by a heuristic: where a learner would act at random, it takes the heuristic's action.

Haksar and Schwager, "Distributed Deep Reinforcement Learning for Fighting Forest Fires with a Network of Aerial
Robots", IROS 2018, explore so.
"""

from dataclasses import replace

from tensordict import TensorDictBase
from tensordict.nn import TensorDictModuleBase, TensorDictSequential
from torch.nn.functional import one_hot
from torchrl.modules import EGreedyModule

from warp_torchrl.algorithms.learner import Learner
from warp_torchrl.collection.imitation import Imitation
from warp_torchrl.env import WildfireEnv
from warp_torchrl.heuristics import HEURISTICS, Heuristic
from warp_torchrl.heuristics.heuristic import instructor
from warp_torchrl.models import ACTION, ACTION_MASK


def guided(learner: Learner, imitation: Imitation, env: WildfireEnv) -> Learner:
    """Return the learner whose collector's policy explores by the guide's actions; unchanged without a guide.

    Args:
        learner: A learner that explores by TorchRL's epsilon-greedy module, the last of its collector's policy.
        imitation: Names the guide, which may see more than the team does.
        env: The training environment.
    """
    if imitation.guide is None:
        return learner
    *acts, explores = learner.explore.module
    guide = instructor(HEURISTICS[imitation.guide], env, imitation.privileged)
    return replace(learner, explore=_Guided(TensorDictSequential(*acts), explores, guide))


class _Guided(TensorDictModuleBase):
    """A policy whose epsilon-greedy module receives the guide's action as the only open one."""

    def __init__(self, policy: TensorDictSequential, explores: EGreedyModule, guide: Heuristic) -> None:
        super().__init__()
        self.in_keys, self.out_keys = policy.in_keys, policy.out_keys
        self.policy, self.explores, self._guide = policy, explores, guide

    def forward(self, tensordict: TensorDictBase) -> TensorDictBase:
        """Write the team's actions, int64 [B, A]."""
        out = self.policy(tensordict)
        mask = tensordict.get(ACTION_MASK)
        said = self._guide(tensordict.select(ACTION_MASK)).get(ACTION)
        shown = out.select(ACTION, ACTION_MASK).set(ACTION_MASK, one_hot(said, mask.shape[-1]).to(mask.dtype))
        return out.set(ACTION, self.explores(shown).get(ACTION))
