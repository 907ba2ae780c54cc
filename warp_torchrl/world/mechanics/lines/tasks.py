"""Tasks of agents: the share of the work on a cell that a step does, and the flames beside it."""

from dataclasses import dataclass
from typing import NamedTuple

import torch
from torch import Tensor

from warp_torchrl.world.arrays.batch import Batch
from warp_torchrl.world.arrays.constants import numbers
from warp_torchrl.world.law.flames import front_towards, strongest_into
from warp_torchrl.world.mechanics.lines.production import BUILDERS, metres_a_minute
from warp_torchrl.world.state.state import WorldState
from warp_torchrl.world.team.abilities import AgentContext, own_cell, youngest_fire
from warp_torchrl.world.team.acting import is_second

DONE = 1 << 14
"""Parts of the work on a cell."""
AIRCRAFT = len(BUILDERS)
"""Index of aircraft, which build no line, after the builders."""
LATENT = 2600.0
"""kJ that a kilogram of water takes up as it warms and boils away."""


@dataclass(eq=False, repr=False)
class Lines(Batch):
    """The work on each cell, and what its pace follows from."""

    heat: Tensor | None  # float32 [B,H,W], of an area that burns [kJ/m2]; None under laws without intensity
    kind: Tensor  # uint8 [B,H,W], fuel and slope, see ``production.kinds_of``
    work: Tensor  # int16 [B,H,W], of ``DONE`` parts of a line, below 0 of putting out; of a firebreak its width [dm]
    means: Tensor  # int64 [B,A], of each agent: index in ``BUILDERS``, or ``AIRCRAFT``
    worked: Tensor  # int32 [B], steps of agents that got work done
    minutes: float  # of a step
    last_spreading: int  # cell code of the last stage that can be put out


class Pace(NamedTuple):
    """What the pace of work follows from in all worlds."""

    strongest: tuple[float, ...]  # intensity at which each means still works [kW/m]
    alike: float  # intensity of all fire under laws without one [kW/m]
    seconds: float  # that a metre of front of 1 kW/m takes
    gain: float  # factor on the rates of line


class Task(NamedTuple):
    """What agents can do where they are, [B, A] each."""

    intensity: Tensor  # float32, of the flames that they would work at [kW/m]; 0 without any that matter
    share: Tensor  # int64, of ``DONE`` parts in a step; 0 where flames or ground forbid it


class Progress(NamedTuple):
    """The work after a step."""

    works: Tensor  # bool [B,A], which agents got some done
    first: Tensor  # bool [B,A], which of them are the first at their cell
    done: Tensor  # bool [B,A], whether the cell of each is completed
    work: Tensor  # int16 [B,H,W], see ``Lines``


def progress(work: Tensor, target: Tensor, puts_out: Tensor, parts: Tensor, width: Tensor) -> Progress:
    """Return the work after agents added to it; work on a line is lost where fire came, and on a fire when it is out.

    Args:
        work: Before, see ``Lines``.
        target: Flat index of each agent's cell, int64 [B, A].
        puts_out: Which agents put out fire, bool [B, A]; the others build line.
        parts: That each adds, int64 [B, A]; 0 where an agent does not work.
        width: Of the lines of each, int64 [B, A] [dm].
    """
    sign, old = torch.where(puts_out, -1, 1), work.flatten(1).gather(1, target).long()
    same = target[:, :, None] == target[:, None, :]
    total = (sign * old).clamp(min=0) + (same * parts[:, None, :]).sum(dim=-1)
    works, done = parts > 0, total >= DONE
    first = works & ~is_second(target, works)
    new = torch.where(done, torch.where(puts_out, 0, width), sign * total)
    change = torch.where(first, new - old, 0).to(work.dtype)
    return Progress(works, first, done, work.flatten(1).scatter_add(1, target, change).view_as(work))


def fire_beside(state: WorldState) -> tuple[Tensor, Tensor]:
    """Return the fire that each agent would put out, see ``youngest_fire``."""
    return youngest_fire(state, state.planes("lines", Lines).last_spreading)


def at_fire(state: WorldState, target: Tensor, pace: Pace) -> Task:
    """Return the task to put out fires, int64 [B, A], whose fronts go towards the agents."""
    lines, size = state.planes("lines", Lines), state.ground.cell_size
    strong = front_towards(state, lines.heat, pace.alike, target, state.vehicles.position)
    minutes = strong * (pace.seconds * size / 60.0)
    share = (DONE * lines.minutes / minutes.clamp(min=1e-6)).clamp(1.0, DONE).long()
    return _within(strong, torch.where(lines.means == AIRCRAFT, DONE, share), lines, pace)


def at_line(state: WorldState, pace: Pace) -> Task:
    """Return the task to clear the agents' own cells, at the strongest front that would come from a neighbour."""
    lines, own = state.planes("lines", Lines), own_cell(state)
    rate = metres_a_minute(AgentContext.at(lines.kind, own), lines.means)
    share = rate * (DONE * pace.gain * lines.minutes / state.ground.cell_size)
    share = torch.where(rate > 0.0, share.clamp(1.0, DONE), 0.0).long()
    if lines.heat is None and pace.alike <= min(pace.strongest):  # no flames matter
        return Task(torch.zeros_like(rate), share)
    return _within(strongest_into(state, lines.heat, pace.alike, own), share, lines, pace)


def _within(strong: Tensor, share: Tensor, lines: Lines, pace: Pace) -> Task:
    """Return a task at flames of some intensity; nothing is done at those over the limit."""
    limit = numbers(pace.strongest, strong.device)[lines.means]
    return Task(strong, share * (strong <= limit))
