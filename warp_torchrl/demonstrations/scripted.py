"""Scripted person: a repeatable stand-in for a person at a keyboard."""

from collections import deque
from dataclasses import dataclass

import torch
from torch import Tensor

from warp_torchrl.heuristics import TEACHERS
from warp_torchrl.validation import check_fields, did_you_mean


@dataclass(frozen=True, kw_only=True)
class Person:
    """Rule by which a scripted person corrects a policy.

    The person takes over the vehicle whose policy is least sure, one at a time, drives it as a baseline would with a
    delay and with errors, and hands it back when its policy is sure again.

    Attributes:
        by: The baseline that drives, one of ``TEACHERS``.
        delay: Reaction time [steps]; a vehicle that was just taken over waits for as long.
        error: Probability of a random open act instead of the baseline's.
        threshold: Probability of its likeliest act below which a policy is not sure; at 1 the person always drives.

    Raises:
        ValueError: If the baseline is unknown or a value is out of its range.
    """

    by: str = "coordinated"
    delay: int = 1
    error: float = 0.1
    threshold: float = 0.5

    def __post_init__(self) -> None:
        check_fields(self, delay=(0, 1000), error=(0.0, 1.0), threshold=(0.0, 1.0))
        if self.by not in TEACHERS:
            hint = did_you_mean(self.by, TEACHERS)
            raise ValueError(f"by must be one of {', '.join(TEACHERS)}, got {self.by}{hint}")


class ScriptedPerson:
    """A scripted person in one episode.

    Args:
        person: How they correct.
        seed: Of their errors.
    """

    def __init__(self, person: Person, seed: int) -> None:
        self.person = person
        self.agent: int | None = None
        """The vehicle that they drive."""
        self._seen: deque[int] = deque(maxlen=person.delay + 1)
        self._draws = torch.Generator().manual_seed(seed)

    def drive(self, chances: Tensor, advice: Tensor, is_open: Tensor) -> int | None:
        """Choose the vehicle to drive in a step, and return its act; None for no act.

        Args:
            chances: Probability of each act by the policy, float32 [A, actions].
            advice: The baseline's actions, int64 [A].
            is_open: Acts that do something, bool [A, actions].
        """
        sure = torch.where(is_open.any(-1), chances.amax(-1), 1.0)  # one that can do nothing needs nobody
        if self.agent is not None and sure[self.agent] >= self.person.threshold:
            self.agent = None
        if self.agent is None and sure.min() < self.person.threshold:
            self.agent = int(sure.argmin())
            self._seen.clear()
        if self.agent is None:
            return None
        self._seen.append(int(advice[self.agent]))
        if len(self._seen) <= self.person.delay:
            return None
        if float(torch.rand((), generator=self._draws)) >= self.person.error:
            return self._seen[0]
        choices = is_open[self.agent].nonzero()[:, 0]
        if not len(choices):
            return None
        return int(choices[torch.randint(len(choices), (), generator=self._draws)])
