"""Fires alone under law ``rate``: many on one map, in weather by the hour, from their ignition to an end."""

import math
from collections import deque
from collections.abc import Callable, Iterable, Iterator, Sequence
from concurrent.futures import Future, ThreadPoolExecutor
from dataclasses import dataclass

import torch
from torch import Tensor

from warp_torchrl.rates.spread import Spread
from warp_torchrl.world.fast.spreading import Hour, Spreading
from warp_torchrl.world.fuel_bed import moisture_row
from warp_torchrl.world.rate import TICKS_PER_CELL, RateFire
from warp_torchrl.world.state import Landscape
from warp_torchrl.world.travel import travel

_LEAST_TICKS = 4  # of a spell: the fire's edge goes on from the times of the tick before
_BUT_FASTEST = 0.999  # share of the cells whose rates set the ticks
_AT_ONCE = 64  # fires, whose planes a CPU's cache holds


@dataclass(frozen=True, eq=False)
class Spell:
    """A time in which the weather stays as it is."""

    wind: Tensor  # (u east, v north) of the air's motion at 10 m, float32 [2] [m/s]
    minutes: float  # how long it lasts
    moisture: Tensor | None = None  # float32 [7], in the order of ``fuel_bed.MOISTURES``, NaN where not known


def spread_in(fire: RateFire, landscape: Landscape, cell_size: float, spell: Spell) -> Spread:
    """Return what a fire's head does in each cell of one landscape [1, H, W] in a spell."""
    row = moisture_row(fire.moisture)
    moisture = row if spell.moisture is None else torch.where(spell.moisture.isnan(), row, spell.moisture)
    return fire.bed.spread(landscape, spell.wind[None, :, None, None], moisture[None], cell_size)


def arrival_minutes(
    fire: RateFire,
    landscape: Landscape,
    lit: Tensor,
    key: Tensor,
    spells: Sequence[Spell],
    cell_size: float,
) -> Iterator[Tensor]:
    """Return when each fire reaches each cell, some fires at a time.

    Ticks are as short in each spell as its fastest cells ask for; ``fire.minutes_per_tick`` is not read.

    Args:
        fire: The automaton.
        landscape: One landscape, batch size [1].
        lit: The cells that burn at minute 0, bool [H, W], or of each fire [B, H, W].
        key: Of the fires, int64 [B]: their draws of rates.
        spells: The weather.
        cell_size: Side of a cell [m].

    Yields:
        float32 [b, H, W] [minutes], in order; ``travel.NEVER`` where the fire does not come.
    """
    fuel = (fire.flammability(landscape)[0] > 0.0) & (landscape.age[0] >= fire.youngest_fuel)
    hours = [hour_of(fire, landscape, cell_size, spell, fuel) for spell in spells]
    size = (fuel.shape[0], fuel.shape[1])

    def burned(part: tuple[Tensor, Tensor]) -> Tensor:
        fires = Spreading(part[1], fuel, fire.pace(part[0], size))
        fires.burn(hours)
        return fires.arrival().clone()

    parts = zip(key.split(_AT_ONCE), lit.expand(len(key), *size).split(_AT_ONCE), strict=True)
    yield from _side_by_side(burned, parts, 1 if lit.is_cuda else torch.get_num_threads())


def _side_by_side(
    function: Callable[[tuple[Tensor, Tensor]], Tensor], parts: Iterable[tuple[Tensor, Tensor]], workers: int
) -> Iterator[Tensor]:
    """Yield a function of each part, in order, computed by so many threads.

    Few operations of a fire are large enough for torch's own threads, so fires take one each.
    """
    if workers == 1:
        yield from map(function, parts)
        return
    waiting: deque[Future[Tensor]] = deque()
    with ThreadPoolExecutor(workers, initializer=torch.set_num_threads, initargs=(1,)) as pool:
        for part in parts:
            waiting.append(pool.submit(function, part))
            if len(waiting) > workers:
                yield waiting.popleft().result()
        while waiting:
            yield waiting.popleft().result()


def hour_of(fire: RateFire, landscape: Landscape, cell_size: float, spell: Spell, fuel: Tensor) -> Hour:
    """Return the times of ways in a spell, and ticks as short as its fastest cells but one in a thousand ask for.

    Args:
        fire: The automaton.
        landscape: One landscape, batch size [1].
        cell_size: Side of a cell [m].
        spell: The weather.
        fuel: Cells that can ignite, bool [H, W].
    """
    spread = spread_in(fire, landscape, cell_size, spell)
    rates = spread.head[0][fuel]
    fastest = float(rates.kthvalue(max(1, math.ceil(_BUT_FASTEST * len(rates)))).values) if len(rates) else 0.0
    ticks = max(_LEAST_TICKS, math.ceil(TICKS_PER_CELL * spell.minutes * fastest / cell_size))
    made = travel(spread.head, spread.direction, spread.length_to_breadth, cell_size)[0]
    return Hour(made, spell.minutes / ticks, ticks)
