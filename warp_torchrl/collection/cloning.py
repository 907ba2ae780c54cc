"""Behaviour cloning of people beside reinforcement: a term in the loss, over acts that were recorded before.

Each optimiser step draws a minibatch of acts, and adds -log pi(act of the person | what the agent saw). Aggregating
recordings in which people correct the policy that is being trained is DAgger with people for experts (Ross et al.,
"A Reduction of Imitation Learning and Structured Prediction to No-Regret Online Learning", 2011).
"""

from dataclasses import dataclass, replace
from typing import Any

import torch
from tensordict import TensorDictBase
from torch import Tensor

from warp_torchrl.algorithms import parallel
from warp_torchrl.algorithms.learner import Learner
from warp_torchrl.collection.imitation import CLONING_COLUMN, CLONING_LOSS, Imitation
from warp_torchrl.models import ACTION

AGENT = ("agents", "agent")
"""Which agent of its team an act is of, int64 [n, 1]."""


@dataclass(frozen=True)
class Demonstrations:
    """Acts of people, for networks to learn from.

    Attributes:
        acts: Batch size [n], each a team of one: the entries that the actor reads, the action mask, the action and
            ``AGENT``.
        digest: Digest of the recordings; a run does not resume with others.
    """

    acts: TensorDictBase
    digest: str


def clone(learner: Learner, imitation: Imitation, given: Demonstrations | None, n_networks: int, seed: int) -> Learner:
    """Return the learner with the cloning loss on people's acts added; unchanged without any.

    Args:
        learner: An on-policy learner.
        imitation: How much is cloned, and for how long.
        given: What people did, on the learner's device.
        n_networks: How many agents have an actor of their own; 1 where they share one, or one for each role.
        seed: Of this process's draws of minibatches.
    """
    if given is None:
        return learner
    cloning = _CloningLoss(imitation, learner, _Minibatches(given, imitation.minibatch_size, seed), n_networks)
    has_teacher = CLONING_LOSS in learner.loss_keys
    return replace(
        learner,
        terms=cloning.terms,
        loss_keys=learner.loss_keys if has_teacher else (*learner.loss_keys, CLONING_LOSS),
        columns={**learner.columns, CLONING_LOSS: CLONING_COLUMN},
        schedule=cloning.schedule,
        keeps={**learner.keeps, "demonstrations": cloning.minibatches},
    )


class _CloningLoss:
    """A learner's loss plus the mean negative log-likelihood of people's acts under the masked policy.

    TorchRL's ``BCLoss`` is none of this: for whole-number actions it takes the cross entropy with what the actor writes
    under their key, which is the action that it drew.
    """

    def __init__(self, imitation: Imitation, learner: Learner, minibatches: "_Minibatches", n_networks: int) -> None:
        self.imitation, self.learner, self.minibatches, self.n_networks = imitation, learner, minibatches, n_networks
        self.weight = imitation.weight

    def terms(self, sample: TensorDictBase) -> TensorDictBase:
        """Return the learner's loss terms, the cloning loss among them."""
        terms = self.learner.terms(sample)
        loss = terms.get(CLONING_LOSS, None)
        loss = torch.zeros((), device=sample.device) if loss is None else loss
        if self.weight:
            loss = loss - self.weight * self._log_prob(self.minibatches.draw()).mean()
        return terms.set(CLONING_LOSS, loss)

    def _log_prob(self, acts: TensorDictBase) -> Tensor:
        """Return the log-likelihood of acts, float32 [n, 1]."""
        loss, agent = self.learner.loss, acts.get(AGENT)
        if self.n_networks > 1:  # each network reads the agent's entries, and that of the agent is listened to
            acts = _repeated(acts, self.n_networks)
        with loss.actor_network_params.to_module(loss.actor_network):
            found: Tensor = loss.actor_network.get_dist(acts).log_prob(acts.get(ACTION))
        return found.gather(-1, agent) if self.n_networks > 1 else found

    def schedule(self, progress: float) -> dict[str, float]:
        """Set the weight for progress in 0..1, and return the learner's scheduled columns."""
        self.weight = self.imitation.weight_at(progress)
        return self.learner.schedule(progress)


class _Minibatches:
    """Random minibatches of acts; a checkpoint keeps the generator.

    Args:
        given: Acts of people.
        size: Acts in a minibatch, of all processes.
        seed: Of the draws.
    """

    def __init__(self, given: Demonstrations, size: int, seed: int) -> None:
        self.given, self.size = given, max(1, size // parallel.size())
        self._draws = torch.Generator().manual_seed(seed)

    def draw(self) -> TensorDictBase:
        """Return acts, each as likely as any other, batch size [n]."""
        acts = self.given.acts
        return acts[torch.randint(len(acts), (self.size,), generator=self._draws).to(acts.device)]

    def state_dict(self) -> dict[str, Any]:
        """Return the state of the generator, and the digest of the recordings."""
        return {"random": self._draws.get_state(), "recordings": self.given.digest}

    def load_state_dict(self, state: dict[str, Any]) -> None:
        """Restore what ``state_dict`` returned.

        Raises:
            ValueError: If it is of other recordings.
        """
        if state["recordings"] != self.given.digest:
            raise ValueError("imitation.demonstrations must hold the recordings that the run began with, and no others")
        self._draws.set_state(state["random"])


def _repeated(acts: TensorDictBase, times: int) -> TensorDictBase:
    """Return acts [n] of teams of one as acts of teams whose agents all see and do the same."""
    return acts.apply(lambda each: each.expand(-1, times, *each.shape[2:]))
