"""Loads of aircraft: the cells that they cover, and the fronts that they hold there."""

from dataclasses import dataclass
from typing import NamedTuple

import torch
from torch import Tensor
from torch.nn.functional import threshold

from warp_torchrl.world.arrays.batch import Batch
from warp_torchrl.world.arrays.bytes import above
from warp_torchrl.world.arrays.constants import whole_numbers
from warp_torchrl.world.arrays.geometry import grow, offsets
from warp_torchrl.world.arrays.shortlist import first_cells
from warp_torchrl.world.arrays.squares import clamped
from warp_torchrl.world.behaviour.firebreaks import intensity_of
from warp_torchrl.world.law.automaton import at_cells
from warp_torchrl.world.law.flames import front_towards, strongest_into
from warp_torchrl.world.state.cells import is_burning, is_tree
from warp_torchrl.world.state.state import FIRST_FIRE, WorldState
from warp_torchrl.world.team.acting import changed, is_second

LITRES_PER_LEVEL = 0.40746
"""Litres to a square metre in a coverage level of 1, a US gallon to 100 square feet."""
_NEEDED = (1, 1, 2, 3, 8, 3, 6, 6, 2, 2, 4, 3, 8, 8)
"""Coverage level by Anderson's number, 0 first: 1, 2, 3, 5 and 8 to 11 by table 1 of the airtanker drop guides of the
US Forest Service. Those of 4, 6, 7, 12 and 13 are ours: 6 for tall brush, 8 for heavy fuels, which need more than 6
(NWCG, glossary)."""
_SHARE, _FEWEST = 256, 16
"""One in so many cells of a map is covered and beside fire in a tick at most, or as many as that on a small one."""
LEAST = 0.05
"""Coverage level that counts as none."""


@dataclass(eq=False, repr=False)
class Loads(Batch):
    """What aircraft have dropped, and how soon they drop again."""

    heat: Tensor | None  # float32 [B,H,W], of an area that burns [kJ/m2]; None under laws without intensity
    fuel: Tensor  # uint8 [B,H,W], Anderson's number
    coverage: Tensor  # float32 [B,H,W], level that is left [US gallons to 100 square feet]
    aircraft: Tensor  # bool [B,A], drops what it carries
    heading: Tensor  # int64 [B,A], direction of the last move, north before the first
    waits: Tensor  # int32 [B,A], steps until it has loaded
    smoke: Tensor | None  # float32 [B,A], over each agent; None where no smoke is too much
    drops: Tensor  # int32 [B], so far
    hits: Tensor  # int32 [B], of which put out a fire
    minutes: float  # of a tick
    turnaround: int  # steps to load
    last_spreading: int  # cell code of the last stage that can be put out


class Load(NamedTuple):
    """A load, alike of all aircraft."""

    length: float  # of the line that it covers [m]
    level: float  # coverage level [US gallons to 100 square feet]
    holds: float  # flames that the level of the fuel holds [m]
    most: float  # flames over which none holds [m]
    half_life: float  # of the level [minutes]
    alike: float  # intensity of all fire under laws without one [kW/m]

    @property
    def least(self) -> float:
        """Return the intensity of the strongest fronts that its level holds in any fuel [kW/m]."""
        return min(intensity_of(self.holds) * self.level / max(_NEEDED), intensity_of(self.most))


@dataclass(eq=False, repr=False)
class Drop(Batch):
    """Loads that fall in worlds."""

    state: WorldState  # after all other acts
    cells: Tensor  # uint8 [B,H,W], the cells before them
    falls: Tensor  # bool [B,A], which agents drop
    target: Tensor  # int64 [B,A], flat index of the first cell of each
    hit: Tensor  # bool [B,A], which have put out a fire


def fallen(drop: Drop, load: Load) -> Drop:
    """Return worlds after loads have fallen, and which of them put out a fire."""
    after, there = drop.state, drop.state.replace(cells=drop.cells)
    loads, (height, width) = after.planes("drops", Loads), after.cells.shape[1:]
    count = min(max(1, round(load.length / there.ground.cell_size)), max(height, width))
    cells, on_map = pattern(drop.target, loads.heading, count, (height, width))
    cell, falls = cells.flatten(1), (on_map & drop.falls[..., None]).flatten(1)
    codes, wet = at_cells(after.cells, cell), at_cells(after.wet, cell).clamp(min=1)
    out = falls & (codes >= FIRST_FIRE) & (codes <= loads.last_spreading)
    stands = falls & is_tree(codes)
    if loads.heat is not None or load.alike >= load.least:  # else any drop holds all flames
        place = there.vehicles.position[:, :, None].expand(-1, -1, count, -1).flatten(1, 2)
        front = front_towards(there, loads.heat, load.alike, cell, place)
        most = held_intensity(torch.full_like(front, load.level), at_cells(loads.fuel, cell), load)
        out = out & (front <= most)
        stands = stands & (strongest_into(after, loads.heat, load.alike, cell) <= most)
    first = ~is_second(cell, out | stands)  # a cell burns or stands, not both
    out, stands = out & first, stands & first
    becomes: dict[str, Tensor | int] = {"cells": at_cells(after.age, cell), "age": 0, "extinguished": 1, "wet": wet}
    after = changed(after, cell, [(out, becomes), (stands, {"wet": wet})])
    coverage = loads.coverage.flatten(1).scatter_reduce(1, cell, load.level * falls, "amax").view_as(loads.coverage)
    after = after.with_planes("drops", loads.replace(coverage=coverage))
    return drop.replace(state=after, hit=out.view_as(cells).any(dim=-1))


def held(state: WorldState, ticks_now: Tensor, load: Load) -> WorldState:
    """Return worlds after a tick, bool [B] where, in which covered trees do not catch fire in the next one.

    The coverage decays, and holds the fronts beside trees or not.
    """
    loads, here = state.planes("drops", Loads), ticks_now[:, None, None]
    coverage = loads.coverage * torch.where(here, 0.5 ** (loads.minutes / load.half_life), 1.0)
    coverage = threshold(coverage, LEAST, 0.0)
    near = here & above(coverage, 0.0) & is_tree(state.cells) & grow(is_burning(state.cells))
    cell, is_near = first_cells(near, max(_FEWEST, near[0].numel() // _SHARE))
    front = strongest_into(state, loads.heat, load.alike, cell)
    holds = front <= held_intensity(at_cells(coverage, cell), at_cells(loads.fuel, cell), load)
    after = changed(state, cell, [(is_near & holds, {"wet": at_cells(state.wet, cell).clamp(min=1)})])
    return after.with_planes("drops", loads.replace(coverage=coverage))


def pattern(target: Tensor, heading: Tensor, count: int, size: tuple[int, int]) -> tuple[Tensor, Tensor]:
    """Return the cells of drops along their headings, and which of them are on the map.

    Args:
        target: Flat index of the first cell of each, int64 [B, A].
        heading: Its direction, int64 [B, A], as ``geometry.DIRECTIONS``.
        count: Cells of each.
        size: (H, W) of the map.

    Returns:
        int64 and bool [B, A, count].
    """
    ahead = torch.arange(count, device=target.device)
    start = torch.stack((target.div(size[1], rounding_mode="floor"), target % size[1]), dim=-1)
    place, is_on_map = clamped(start[..., None] + offsets(target.device)[heading][..., None] * ahead, size)
    (row, column), (has_row, has_column) = place.unbind(-2), is_on_map.unbind(-2)
    return torch.add(column, row, alpha=size[1]), has_row & has_column


def held_intensity(level: Tensor, fuel: Tensor, load: Load) -> Tensor:
    """Return the intensity of the fronts that a coverage holds, float32, shape of the levels [kW/m].

        I = I(L) c / n,    at most I(L_most)

    n is the level that the fuel needs, see ``_NEEDED``; I(L) is Byram's intensity of flames
    of length L. That it goes with the water on an area is ours.

    Args:
        level: c.
        fuel: Anderson's number, uint8.
        load: Its ``holds`` is L, its ``most`` L_most.
    """
    needed = whole_numbers(_NEEDED, fuel.device)[fuel.long()]
    return (level * (intensity_of(load.holds) / needed)).clamp(max=intensity_of(load.most))


def coverage_map(state: WorldState) -> Tensor:
    """Return ten times the coverage level of each cell, uint8 [B, H, W]."""
    return (10.0 * state.planes("drops", Loads).coverage).clamp(max=255.0).round().to(torch.uint8)
