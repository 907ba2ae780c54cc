"""Timetables of vehicles: when each is on the scene, how long until it comes, and how long until it leaves."""

from dataclasses import dataclass
from typing import NamedTuple

from torch import Tensor

from warp_torchrl.world.arrays.constants import numbers

NEVER = 1e9
"""Minutes of what does not happen."""


class Timetable(NamedTuple):
    """Where vehicles are in their timetables, [B, A] each."""

    present: Tensor  # bool, is on the scene
    until_there: Tensor  # float32, until it is there [minutes]; 0 where it is, ``NEVER`` where it does not come
    until_gone: Tensor  # float32, until it leaves [minutes]; 0 where it is not there, ``NEVER`` where it stays


@dataclass(frozen=True)
class Duties:
    """How each vehicle works and rests, in minutes.

    From its first arrival it is on the scene for a time, then away for a time, and so on, until it leaves for good.

    Attributes:
        stays: On the scene at a time, of each vehicle.
        away: Between two stays.
        until: From the start of the episode until it leaves for good.
    """

    stays: tuple[float, ...]
    away: tuple[float, ...]
    until: tuple[float, ...]

    def at(self, arrives: Tensor, now: Tensor) -> Timetable:
        """Return where vehicles are in their timetables.

        Args:
            arrives: When each first arrives, float32 [B, A] [minutes].
            now: float32 [B, 1] [minutes].
        """
        stays, away, until = (numbers(each, arrives.device) for each in (self.stays, self.away, self.until))
        since, cycle = now - arrives, stays + away
        within = since.clamp(min=0.0) % cycle
        is_due = (since >= 0.0) & (within < stays)
        present = is_due & (now < until)
        wait = (-since).where(since < 0.0, cycle - within).masked_fill(is_due, 0.0)
        comes = ~present & (now + wait < until) & (wait < 0.5 * NEVER)
        gone = (stays - within).minimum(until - now)
        gone = gone.masked_fill(gone > 0.5 * NEVER, NEVER).masked_fill(~present, 0.0)
        return Timetable(present, wait.masked_fill(~comes, NEVER).masked_fill(present, 0.0), gone)
