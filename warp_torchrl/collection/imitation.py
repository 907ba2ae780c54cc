"""Configuration of imitation: a teacher, people, or both."""

from dataclasses import dataclass
from pathlib import Path

from warp_torchrl.algorithms.algorithm import Algorithm
from warp_torchrl.algorithms.dqn import Dqn
from warp_torchrl.algorithms.on_policy import OnPolicy
from warp_torchrl.collection.collectors import InProcess, MultiProcess
from warp_torchrl.heuristics import HEURISTICS, TEACHERS
from warp_torchrl.models import Mlp
from warp_torchrl.system.shipped import policy_names
from warp_torchrl.validation import check_fields, did_you_mean

CLONING_LOSS, CLONING_COLUMN = "loss_bc", "train/cloning_loss"
"""The term of the loss, the sum of the teacher's and the people's where there are both, and its column."""


@dataclass(frozen=True, kw_only=True)
class Imitation:
    """Sources of imitation besides the rewards: a teacher, people, or both.

    The two losses add up, each a mean over its samples, under the same weight. Reports of such a policy should name
    its sources.

    Attributes:
        teacher: Labels the states that the team visits: one of ``TEACHERS``, a shipped policy, a run folder or a
            checkpoint; None has no teacher.
        privileged: Whether a heuristic that teaches or guides sees the true worlds (Chen et al., "Learning by
            Cheating", 2020); if not, it acts on what the team knows, as in play.
        demonstrations: Folder of recordings, whose acts of people are cloned; None clones nothing.
        minibatch_size: Acts of people in an optimiser step, of all processes.
        weight: Weight of the cloning losses at the start; it falls linearly.
        weight_end: Weight that stays. A little keeps a team near its teacher where its rewards carry no signal.
        until: Share of the training after which the weight is ``weight_end``.
        guide: One of ``TEACHERS``, whose actions ``dqn``, ``vdn`` and ``qmix`` take when they explore; None explores at
            random.

    Raises:
        ValueError: If the teacher or the guide is unknown or a value is out of its range.
    """

    teacher: str | None = None
    privileged: bool = True
    demonstrations: str | None = None
    minibatch_size: int = 256
    weight: float = 1.0
    weight_end: float = 0.0
    until: float = 0.3
    guide: str | None = None

    def __post_init__(self) -> None:
        check_fields(self, weight=(1e-6, 1e6), weight_end=(0.0, 1e6), until=(1e-6, 1.0), minibatch_size=(1, 1_000_000))
        if self.teacher is not None:
            check_teacher(self.teacher)
        if self.guide is not None and self.guide not in TEACHERS:
            hint = did_you_mean(self.guide, TEACHERS)
            raise ValueError(f"guide must be null or one of {', '.join(TEACHERS)}, got {self.guide}{hint}")

    def weight_at(self, progress: float) -> float:
        """Return the weight at progress in 0..1."""
        return self.weight_end + (self.weight - self.weight_end) * max(0.0, 1.0 - progress / self.until)

    def check_fits(self, algorithm: Algorithm, collector: InProcess, model: Mlp) -> None:
        """Check that the algorithm, the collector and the networks allow the sources of imitation.

        Raises:
            ValueError: If the algorithm is off-policy, or does not explore by a guide, workers collect for a teacher
                or a guide, or networks that remember, talk or belong to an agency would learn from single acts.
        """
        given = [name for name in ("teacher", "demonstrations") if getattr(self, name) is not None]
        if given and not isinstance(algorithm, OnPolicy):
            raise ValueError(f"{given[0]} must be null where the algorithm replays: choose mappo, ippo, ppo or a2c")
        if self.guide is not None and not isinstance(algorithm, Dqn):
            raise ValueError("guide must be null where the algorithm does not explore by it: choose dqn, vdn or qmix")
        for name in ("teacher", "guide"):
            if getattr(self, name) is not None and isinstance(collector, MultiProcess):
                raise ValueError(f"{name} must be null where workers collect: choose collector=direct")
        if self.demonstrations is not None and model.memory:
            raise ValueError(
                "demonstrations must be null where agents remember, since acts are learned one by one: choose "
                f"model.memory=0, got {model.memory}"
            )
        if self.demonstrations is not None and model.sharing == "agency":
            raise ValueError("demonstrations must be null where each agency has a network, since acts name none")
        if self.demonstrations is not None and model.talks:
            raise ValueError(
                "demonstrations must be null where agents talk, since acts are learned one by one: choose "
                f"model.messages=none or map, got {model.messages}"
            )


def check_teacher(name: str) -> None:
    """Check that there is a teacher of a name: a heuristic, a shipped policy, or a folder.

    Raises:
        ValueError: If there is none.
    """
    shipped = policy_names()
    if name not in (*TEACHERS, *shipped) and (name in HEURISTICS or not Path(name).is_dir()):
        known = (*TEACHERS, *shipped)
        raise ValueError(
            f"teacher must be null or one of {', '.join(known)}, or a run folder, got {name}{did_you_mean(name, known)}"
        )
