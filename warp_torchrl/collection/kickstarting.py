"""Kickstarting: a behaviour-cloning term in the loss, whose weight falls to 0 during training.

The student acts; a heuristic teacher labels the visited states with its own actions (Schmitt et al., "Kickstarting Deep
Reinforcement Learning", 2018).
"""

from dataclasses import dataclass, replace

import torch
from tensordict import TensorDictBase
from tensordict.nn import TensorDictModuleBase
from torch import Tensor, nn
from torch.nn.functional import cross_entropy

from warp_torchrl.algorithms.algorithm import Algorithm
from warp_torchrl.algorithms.learner import Learner
from warp_torchrl.algorithms.on_policy import OnPolicy
from warp_torchrl.collection.collectors import InProcess, MultiProcess
from warp_torchrl.env import WildfireEnv
from warp_torchrl.heuristics import HEURISTICS, Heuristic
from warp_torchrl.models import ACTION, ACTION_MASK, LOGITS, TEACHER_ACTION
from warp_torchrl.nearest import did_you_mean
from warp_torchrl.validation import check_fields

TEACHERS = tuple(name for name, heuristic in HEURISTICS.items() if not heuristic.is_stateful)
"""Heuristics that can be teachers: their action depends on the state alone."""
_LOSS, _COLUMN = "loss_bc", "train/cloning_loss"


@dataclass(frozen=True, kw_only=True)
class Kickstarting:
    """Configuration of the teacher, which may see more than the team does.

    Reports of such a policy should say that it had a teacher.

    Attributes:
        teacher: One of ``TEACHERS``; None learns from rewards alone.
        weight: Weight of the cloning loss at the start; it falls linearly.
        until: Share of the training after which the weight is 0.

    Raises:
        ValueError: If the teacher is unknown or a value is out of its range.
    """

    teacher: str | None = None
    weight: float = 1.0
    until: float = 0.3

    def __post_init__(self) -> None:
        check_fields(self, weight=(1e-6, 1e6), until=(1e-6, 1.0))
        if self.teacher is not None and self.teacher not in TEACHERS:
            hint = did_you_mean(self.teacher, TEACHERS)
            raise ValueError(f"teacher must be null or one of {', '.join(TEACHERS)}, got {self.teacher}{hint}")

    def check_fits(self, algorithm: Algorithm, collector: InProcess) -> None:
        """Check that the algorithm and the collector allow the teacher.

        Raises:
            ValueError: If there is a teacher and the algorithm is off-policy, or workers collect.
        """
        if self.teacher is not None and not isinstance(algorithm, OnPolicy):
            raise ValueError("teacher must be null where the algorithm replays: choose mappo, ippo, ppo or a2c")
        if self.teacher is not None and isinstance(collector, MultiProcess):
            raise ValueError("teacher must be null where workers collect: choose collector=direct")

    def kickstart(self, learner: Learner, env: WildfireEnv) -> Learner:
        """Return the learner with the cloning loss and the teacher added; unchanged without a teacher.

        Args:
            learner: A learner whose policy writes logits first.
            env: The training environment.
        """
        if self.teacher is None:
            return learner
        cloning = _KickstartingLoss(self, learner)
        return replace(
            learner,
            explore=_Student(learner.explore, HEURISTICS[self.teacher](env), cloning),
            terms=cloning.terms,
            loss_keys=(*learner.loss_keys, _LOSS),
            columns={**learner.columns, _LOSS: _COLUMN},
            schedule=cloning.schedule,
        )


class _KickstartingLoss:
    """A learner's loss plus the cloning loss, equal to TorchRL's ``BCLoss`` on the teacher's actions.

    It reuses the logits that the learner's loss has just computed on the same sample, and saves a forward pass.
    """

    def __init__(self, plan: Kickstarting, learner: Learner) -> None:
        self.plan, self.learner, self.weight = plan, learner, plan.weight
        learner.loss.actor_network[0].register_forward_hook(self._keep_logits)

    def _keep_logits(self, actor: nn.Module, given: object, said: TensorDictBase) -> None:
        self._logits = said.get(LOGITS)

    def terms(self, sample: TensorDictBase) -> TensorDictBase:
        """Return the learner's loss terms and the cloning loss."""
        terms = self.learner.terms(sample)
        if not self.weight:
            return terms.set(_LOSS, torch.zeros((), device=sample.device))
        return terms.set(_LOSS, self.weight * _log_loss(self._logits, sample.get(TEACHER_ACTION)))

    def schedule(self, progress: float) -> dict[str, float]:
        """Set the weight for progress in 0..1, and return the learner's scheduled columns."""
        self.weight = self.plan.weight * max(0.0, 1.0 - progress / self.plan.until)
        return self.learner.schedule(progress)


class _Student(TensorDictModuleBase):
    """A policy that also writes the teacher's actions while the cloning loss has weight."""

    def __init__(self, policy: TensorDictModuleBase, teacher: Heuristic, cloning: _KickstartingLoss) -> None:
        super().__init__()
        self.in_keys, self.out_keys = policy.in_keys, [*policy.out_keys, TEACHER_ACTION]
        self.policy, self._teacher, self._cloning = policy, teacher, cloning

    def forward(self, tensordict: TensorDictBase) -> TensorDictBase:
        """Write the team's and the teacher's actions, int64 [B, A]; the same once the cloning weight is 0."""
        out = self.policy(tensordict)
        if not self._cloning.weight:
            return out.set(TEACHER_ACTION, out.get(ACTION))
        labelled = self._teacher(tensordict.select(ACTION_MASK))
        return out.set(TEACHER_ACTION, labelled.get(ACTION))


def _log_loss(logits: Tensor, action: Tensor) -> Tensor:
    """Return the negative log-likelihood of actions int64 [...] under logits [..., actions]."""
    return cross_entropy(logits.flatten(0, -2), action.flatten())
