"""Fires without vehicles: time of a thousand under each law, and errors of the ellipses of law ``rate``."""

import math
import time
from collections.abc import Sequence
from typing import Any

import torch
from torch import Tensor

from warp_torchrl.benchmark.tables import entry, table
from warp_torchrl.prediction.simulation import fire_history
from warp_torchrl.world.air.weather import Weather
from warp_torchrl.world.air.wind import Uniform
from warp_torchrl.world.arrays.random import world_key
from warp_torchrl.world.fires.arrival_minutes import arrival_minutes
from warp_torchrl.world.fires.spell import Spell, spells_of, spread_in
from warp_torchrl.world.law.fire import Fire
from warp_torchrl.world.law.hazard import HazardFire
from warp_torchrl.world.law.rate import RateFire
from warp_torchrl.world.state.state import Landscape
from warp_torchrl.world.terrain.landscape import Perlin

_SIZE = (126, 127)
_TICKS = 256  # of the paper's laws, in which their fires cross the map
_AT_ONCE = 64
_C2 = 2
_CELL = 30.0
BEARINGS = (0, 11, 22, 33, 45)
RATIOS = {1.0: 0.0, 2.3: 17.8 / 3.6, 4.6: 36.3 / 3.6}
"""Wind [m/s] at which the Canadian curve has these ratios of length to breadth."""


def law_times(fires: int) -> list[dict[str, Any]]:
    """Return the seconds of ``fires`` fires on one map of 126 x 127 cells under each law, one row per law.

    Law ``rate`` burns for 24 hours of the weather ``august``, the others for the ticks in which their fires cross the
    map, in a wind of 6 m/s.
    """
    ground = Perlin(size=_SIZE, relief=200.0, ages="oldest")(world_key(torch.zeros(1, dtype=torch.int64)))
    lit = torch.zeros(_SIZE, dtype=torch.bool)
    lit[60:63, 20:23] = True
    rows = []
    paper = Fire(growth=True, beta=0.65, p_regrow=0.01)
    for name, fire in (("paper", paper), ("spread", Fire()), ("hazard", HazardFire())):
        began = time.perf_counter()
        burned = _burn_by_ticks(fire, ground, lit, fires, _TICKS * fire.ticks_per_stage)
        rows.append(_row(name, f"{_TICKS * fire.ticks_per_stage} ticks", fires, began, burned))
    began = time.perf_counter()
    spells = spells_of(Weather(path="august"), 24 * 60.0)
    times = arrival_minutes(RateFire(), ground, lit & _fuel(ground), world_key(torch.arange(fires)), spells, _CELL)
    burned = [(part <= 24 * 60.0).float().mean().item() for part in times]
    return [*rows, _row("rate", "24 hours", fires, began, burned)]


def ellipse_errors(reach: int, deviations: Sequence[float]) -> list[dict[str, Any]]:
    """Return the differences of fires on uniform ground from the expected ellipse whose head travels ``reach`` cells.

    A row for each ratio of length to breadth, bearing of the wind against the grid, and ``cell_deviation``.
    """
    return [
        {"length to breadth": ratio, "bearing": bearing, "cell deviation": deviation}
        | _ellipse(reach, ratio, bearing, deviation)
        for deviation in deviations
        for ratio in RATIOS
        for bearing in BEARINGS
    ]


def fire_table(rows: list[dict[str, Any]]) -> str:
    """Return the rows of ``law_times`` or ``ellipse_errors`` as a table."""
    return table([entry(heading) for heading in rows[0]], rows)


def _row(law: str, long: str, fires: int, began: float, burned: list[float]) -> dict[str, Any]:
    share = f"{100.0 * sum(burned) / len(burned):.0f}"
    return {"law": law, "fires": fires, "for": long, "seconds": f"{time.perf_counter() - began:.1f}", "burned %": share}


def _burn_by_ticks(fire: Fire, ground: Landscape, lit: Tensor, fires: int, ticks: int) -> list[float]:
    burned = []
    for first in range(0, fires, _AT_ONCE):
        count = min(_AT_ONCE, fires - first)
        cells = torch.where(lit & (ground.age > 0), 11, ground.age).to(torch.uint8).expand(count, -1, -1).contiguous()
        cover = ground.cover.expand(count, -1, -1).contiguous()
        height = None if ground.elevation is None else ground.elevation.expand(count, -1, -1).contiguous()
        history = fire_history(cells, cover, height, wind=Uniform(speed=6.0), fire=fire, ticks=ticks, seed=first)
        burned.append((history.arrival >= 0).float().mean().item())
    return burned


def _fuel(ground: Landscape) -> Tensor:
    return ground.age[0] > 0


def _ellipse(reach: int, ratio: float, bearing: int, deviation: float) -> dict[str, Any]:
    size, (row, column) = (reach + 30, (reach + 15, 15)) if ratio > 1.0 else (2 * reach + 11, (reach + 5, reach + 5))
    whole = torch.ones(1, size, size, dtype=torch.uint8)
    ground = Landscape(whole * 3, whole * 10, elevation=None).with_layers(fuel=whole.to(torch.int16) * _C2)
    fire, angle = RateFire(model="fbp", cell_deviation=deviation), math.radians(bearing)
    wind = torch.tensor([RATIOS[ratio] * math.sin(angle), RATIOS[ratio] * math.cos(angle)])
    told = spread_in(fire, ground, _CELL, Spell(wind, 1.0)).head[0, 0, 0].item()
    lit = torch.zeros(size, size, dtype=torch.bool)
    lit[row, column] = True
    key, minutes = world_key(torch.arange(8 if deviation else 1)), reach * _CELL / told
    (arrival,) = arrival_minutes(fire, ground, lit, key, [Spell(wind, minutes)], _CELL)
    burned = (arrival <= minutes).nonzero()
    east, north = (burned[:, 2] - column).float(), (row - burned[:, 1]).float()
    along, across = east * math.sin(angle) + north * math.cos(angle), east * math.cos(angle) - north * math.sin(angle)
    heads = [along[burned[:, 0] == each].max().item() for each in range(len(key))]
    lengths, axes = torch.linalg.eigh(torch.cov(torch.stack((along, across))))
    lean = math.degrees(math.atan2(axes[1, 1].item(), axes[0, 1].item()))
    return {
        "head %": f"{100.0 * (sum(heads) / len(heads) / reach - 1.0):+.1f}",
        "ratio %": f"{100.0 * ((lengths[1] / lengths[0]).sqrt().item() / ratio - 1.0):+.1f}",
        "lean": "" if ratio == 1.0 else f"{(lean + 90.0) % 180.0 - 90.0:+.1f}",
    }
