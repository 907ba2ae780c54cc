"""Kickstarting: a behaviour-cloning term in the loss, whose weight falls to 0 during training.

The student acts; a teacher, a heuristic or a trained policy, labels the visited states with its actions (Schmitt et
al., "Kickstarting Deep Reinforcement Learning", 2018).
"""

from dataclasses import replace

import torch
from tensordict import TensorDictBase
from tensordict.nn import TensorDictModuleBase
from torch import Tensor, nn
from torch.nn.functional import cross_entropy

from warp_torchrl.algorithms.learner import Learner
from warp_torchrl.collection.imitation import CLONING_COLUMN, CLONING_LOSS, Imitation
from warp_torchrl.env import WildfireEnv
from warp_torchrl.heuristics import Heuristic
from warp_torchrl.models import ACTION, LOGITS, TEACHER_ACTION
from warp_torchrl.training.teachers import TrainedTeacher, teacher


def kickstart(learner: Learner, imitation: Imitation, env: WildfireEnv, factor: float = 1.0) -> Learner:
    """Return the learner with the cloning loss and the teacher added; unchanged without a teacher.

    Args:
        learner: A learner whose policy writes logits first.
        imitation: Names the teacher, which may see more than the team does.
        env: The training environment.
        factor: Factor on the weight.

    Raises:
        ConfigError: If the teacher is a trained policy that does not fit, remembers or talks.
        CheckpointError: If a folder holds no sound checkpoint.
    """
    if imitation.teacher is None:
        return learner
    cloning = _KickstartingLoss(imitation, learner, factor)
    taught_by = teacher(imitation.teacher, env, imitation.privileged)
    keeps = {"teacher": taught_by} if isinstance(taught_by, TrainedTeacher) else {}
    return replace(
        learner,
        explore=_Student(learner.explore, taught_by, cloning),
        terms=cloning.terms,
        loss_keys=(*learner.loss_keys, CLONING_LOSS),
        columns={**learner.columns, CLONING_LOSS: CLONING_COLUMN},
        schedule=cloning.schedule,
        keeps={**learner.keeps, **keeps},
    )


class _KickstartingLoss:
    """A learner's loss plus the cloning loss, equal to TorchRL's ``BCLoss`` on the teacher's actions.

    It reuses the logits that the learner's loss has just computed on the same sample, and saves a forward pass.
    """

    def __init__(self, imitation: Imitation, learner: Learner, factor: float) -> None:
        self.imitation, self.learner, self.factor, self.weight = imitation, learner, factor, factor * imitation.weight
        learner.loss.actor_network[0].register_forward_hook(self._keep_logits)

    def _keep_logits(self, actor: nn.Module, given: object, said: TensorDictBase) -> None:
        self._logits = said.get(LOGITS)

    def terms(self, sample: TensorDictBase) -> TensorDictBase:
        """Return the learner's loss terms and the cloning loss."""
        terms = self.learner.terms(sample)
        if not self.weight:
            return terms.set(CLONING_LOSS, torch.zeros((), device=sample.device))
        return terms.set(CLONING_LOSS, self.weight * _log_loss(self._logits, sample.get(TEACHER_ACTION)))

    def schedule(self, progress: float) -> dict[str, float]:
        """Set the weight for progress in 0..1, and return the learner's scheduled columns."""
        self.weight = self.factor * self.imitation.weight_at(progress)
        return self.learner.schedule(progress)


class _Student(TensorDictModuleBase):
    """A policy that also writes the teacher's actions while the cloning loss has weight."""

    def __init__(
        self, policy: TensorDictModuleBase, teacher: Heuristic | TrainedTeacher, cloning: _KickstartingLoss
    ) -> None:
        super().__init__()
        self.in_keys, self.out_keys = policy.in_keys, [*policy.out_keys, TEACHER_ACTION]
        self.policy, self._teacher, self._cloning = policy, teacher, cloning

    def forward(self, tensordict: TensorDictBase) -> TensorDictBase:
        """Write the team's and the teacher's actions, int64 [B, A]; the same once the cloning weight is 0."""
        out = self.policy(tensordict)
        if not self._cloning.weight:
            return out.set(TEACHER_ACTION, out.get(ACTION))
        labelled = self._teacher(tensordict.select(*self._teacher.in_keys, strict=False))
        return out.set(TEACHER_ACTION, labelled.get(ACTION))


def _log_loss(logits: Tensor, action: Tensor) -> Tensor:
    """Return the negative log-likelihood of actions int64 [...] under logits [..., actions]."""
    return cross_entropy(logits.flatten(0, -2), action.flatten())
