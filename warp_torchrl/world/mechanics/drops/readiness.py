"""Readiness of aircraft to drop: with a load, by day, and out of smoke."""

from typing import NamedTuple

import torch
from torch import Tensor

from warp_torchrl.world.mechanics.drops.loads import Loads
from warp_torchrl.world.state.state import WorldState

HOURS = 24.0
"""Of a day."""


class Limits(NamedTuple):
    """When aircraft drop, in all worlds."""

    begins: float  # hour of the day at which fires start
    daylight: tuple[float, float]  # hours from which and to which they drop
    smoke: float | None  # the most over an aircraft; None: any


def may_drop(state: WorldState, limits: Limits) -> Tensor:
    """Return which agents may act, bool [B, A]: all but aircraft that load, or are in the dark or in smoke."""
    loads = state.planes("drops", Loads)
    may = (loads.waits == 0) & (daylight_left(state, limits) > 0.0)[:, None]
    if loads.smoke is not None and limits.smoke is not None:
        may = may & (loads.smoke <= limits.smoke)
    return may | ~loads.aircraft


def daylight_left(state: WorldState, limits: Limits) -> Tensor:
    """Return the hours of daylight that are left, float32 [B]; 0 at night."""
    rises, sets = limits.daylight
    hour = (limits.begins + state.tick * (state.planes("drops", Loads).minutes / 60.0)) % HOURS
    return torch.where((hour >= rises) & (hour < sets), sets - hour, 0.0)


def loading(after: WorldState, left: Tensor, running: Tensor, at_base: bool) -> tuple[Tensor, Tensor]:
    """Return the tanks of all vehicles after a step, and the steps that aircraft load, int32 [B, A] each.

    Args:
        after: The worlds after all acts, in which tanks have filled at once.
        left: Of the tanks before they filled, int32 [B, A].
        running: Worlds that go on, bool [B, 1].
        at_base: Whether aircraft load at the base alone.
    """
    loads, vehicles = after.planes("drops", Loads), after.vehicles
    fills = loads.aircraft & running & (vehicles.tank > left)
    if at_base:
        fills = fills & (vehicles.position == vehicles.base[:, None]).all(dim=-1)
    waits = torch.where(running, (loads.waits - 1).clamp(min=0), loads.waits)
    return torch.where(fills | ~loads.aircraft, vehicles.tank, left), torch.where(fills, loads.turnaround, waits)
