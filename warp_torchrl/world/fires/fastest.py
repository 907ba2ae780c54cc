"""Rates of the fastest heads on a map, for the length of ticks."""

import math
from collections.abc import Iterable, Iterator
from dataclasses import dataclass

import torch
from torch import Tensor

from warp_torchrl.world.air.hills import bent
from warp_torchrl.world.backends.spells import Highest, on_strips
from warp_torchrl.world.behaviour.moistures import in_force, moisture_row
from warp_torchrl.world.fires.spell import BUT_FASTEST, Spell, in_sun, rise_of, spread_in
from warp_torchrl.world.law.rate import RateFire
from warp_torchrl.world.state.state import Landscape
from warp_torchrl.world.state.window import Window

_ASKED = 2**17
"""Cells whose heads are computed at most: about a hundred of them are faster than all but one in a thousand."""
_LEAST_FUEL = 2**12  # cells among them that can ignite; where there are fewer, all of the map is asked


@dataclass(frozen=True, eq=False)
class RowsOfMap:
    """Rows of a large map, evenly apart, as a sample of it."""

    ground: Landscape  # of these rows, batch size [1]
    rise: Tensor  # see ``fuel_bed.gradient``, float32 [1, 2, R, W]
    fuel: Tensor  # cells that can ignite, bool [R, W]
    windows: tuple[Window, ...]  # each row

    @classmethod
    def of(cls, landscape: Landscape, fuel: Tensor, cell_size: float) -> "RowsOfMap | None":
        """Return rows of one landscape; None where all of it is asked, since it is small or has little fuel."""
        height, width = fuel.shape
        step = math.ceil(height * width / _ASKED)
        rows = torch.arange(step // 2, height, step)
        if step == 1 or int(fuel[rows].sum()) < _LEAST_FUEL:
            return None
        windows = tuple(Window(row, 0, 1, width, (height, width)) for row in rows.tolist())
        planes = {
            name: leaf.index_select(1, rows) if leaf.dim() == 3 else leaf for name, leaf in landscape.leaves().items()
        }
        rise = torch.cat([rise_of(landscape, window, cell_size) for window in windows], dim=2)
        return cls(landscape.with_leaves(planes), rise, fuel[rows], windows)

    def head(self, fire: RateFire, spell: Spell, cell_size: float) -> Tensor:
        """Return the head's rate in a spell without groups, float32 [R, W] [m/min]."""
        row = moisture_row(fire.moisture)
        wind, moisture = spell.wind.reshape(-1, 2), in_force(spell.moisture, row).reshape(-1, len(row))
        if spell.field is None:
            air = wind[:, :, None, None]
        else:
            each = [spell.here(wind, moisture, window) for window in self.windows]
            air, moisture = torch.cat([one[0] for one in each], dim=2), torch.cat([one[1] for one in each], dim=1)
        levels = [level for window in self.windows if (level := spell.level(window)) is not None]
        moisture = in_sun(spell, moisture, self.ground, self.rise, torch.cat(levels) if levels else None)
        return fire.bed.spread(self.ground, bent(air, self.ground), moisture, cell_size, self.rise).head[0]


def fastest_heads(heads: Iterable[tuple[Tensor, Tensor]], n_fuel: int, n_cells: int) -> tuple[float, float]:
    """Return the rates of the fastest heads but one in a thousand [m/min]: of cells with fuel, and of all.

    Args:
        heads: Rates [h, w], and which cells can ignite, bool [h, w], part by part of a map.
        n_fuel: Cells that can ignite.
        n_cells: All cells.
    """
    of_fuel = Highest(n_fuel - max(1, math.ceil(BUT_FASTEST * n_fuel)) + 1)
    of_all = Highest(n_cells - max(1, round(BUT_FASTEST * n_cells)) + 1)
    for head, fuel in heads:
        of_fuel.add(head[fuel])
        of_all.add(head.flatten())
    return of_fuel.least if n_fuel else 0.0, of_all.least


def heads_of_strips(
    fire: RateFire, landscape: Landscape, cell_size: float, spell: Spell, fuel: Tensor, workers: int
) -> Iterator[tuple[Tensor, Tensor]]:
    """Yield the head's rate of a whole map in a spell without groups, and its fuel, strip by strip."""

    def head(strip: Window) -> Tensor:
        return spread_in(fire, landscape, cell_size, spell, strip).head[0]

    for strip, rate in on_strips(head, (fuel.shape[0], fuel.shape[1]), workers):
        yield rate, strip.cut(fuel, False)
