"""Fires of random beds beside those of the package pyretechnics, an implementation of the same papers by others."""

import math
import random
from collections.abc import Iterator, Mapping, Sequence
from typing import Any, cast

import numpy as np
from torch import Tensor

from warp_torchrl.benchmark.tables import entry, table
from warp_torchrl.world.behaviour.rate_of_spread import rate_of_spread
from warp_torchrl.world.behaviour.spread import Spread
from warp_torchrl.world.behaviour.standard_fuels import NOT_BURNABLE, scott_burgan_40

WATER = {
    **{f"dead_{hours}h": f"fuel_moisture_dead_{hours}hr" for hours in (1, 10, 100)},
    **{f"live_{each}": f"fuel_moisture_live_{each}" for each in ("herbaceous", "woody")},
}
"""Their name of each moisture."""
_SHARES = {"canopy_cover", "foliar_moisture", *WATER.values()}
_CLOSE = 0.01
_NO_CROWN = {"canopy_base_height": 1000.0}  # [m]: no surface fire reaches it
_KINDS = ("surface", "passive", "active crown fire")
_KIND, _HEAD = "kind of fire", ("rate of the head", "intensity", "flame length")


def witness_errors(beds: int, seed: int = 0) -> list[dict[str, Any]]:
    """Return how many random beds agree within 1 %, one row per quantity, and the largest difference.

    Args:
        beds: How many.
        seed: Of the draws.

    Raises:
        ValueError: If the package pyretechnics is not installed.
    """
    drawn = list(crown_beds(beds, seed))
    columns = {name: np.array([bed[name] for bed in drawn]) for name in drawn[0]}
    theirs = np.array([crown_witness(bed) for bed in drawn]).T
    surface = np.array([crown_witness({**bed, **_NO_CROWN})[1] for bed in drawn])
    ours, on_surface = of_crowns(columns), of_crowns(columns, layers=("cover", "height"))
    kind = (cast("Tensor", ours.kind).numpy() == theirs[0]).mean()
    kinds = ", ".join(f"{int((theirs[0] == number).sum())} {name}" for number, name in enumerate(_KINDS))
    rows = [
        _row("surface rate", on_surface.head.numpy(), surface),
        {"quantity": _KIND, "beds": beds, "agree %": f"{100.0 * kind:.2f}", "of them": kinds},
    ]
    fields = (ours.head, ours.intensity, ours.flame_length)
    return rows + [_row(name, own.numpy(), its) for name, own, its in zip(_HEAD, fields, theirs[1:], strict=True)]


def witness_table(rows: Sequence[dict[str, Any]]) -> str:
    """Return the rows of ``witness_errors`` as a table."""
    return table([entry(name) for name in ("quantity", "beds", "agree %", "largest difference %", "of them")], rows)


def crown_beds(count: int, seed: int = 0) -> Iterator[dict[str, float]]:
    """Yield random fuel beds under random canopies, by the names that pyretechnics has for their parts."""
    draw = random.Random(seed)
    codes = sorted(set(scott_burgan_40().codes.tolist()) - set(NOT_BURNABLE.values()))
    for _ in range(count):
        height, dead = draw.uniform(3, 40), draw.uniform(2, 14)
        yield {
            "fuel_model": draw.choice(codes),
            "slope": draw.uniform(0, 40),
            "aspect": draw.uniform(0, 360),
            "wind_speed_10m": draw.uniform(0.5, 20),
            "upwind_direction": draw.uniform(0, 360),
            "canopy_cover": draw.uniform(30, 100),
            "canopy_height": height,
            "canopy_base_height": draw.uniform(0.0, 0.2) * height,
            "canopy_bulk_density": draw.uniform(0.01, 0.35),
            "foliar_moisture": draw.uniform(70, 130),
            "fuel_moisture_dead_1hr": dead,
            "fuel_moisture_dead_10hr": dead + 1,
            "fuel_moisture_dead_100hr": dead + 2,
            "fuel_moisture_live_herbaceous": draw.uniform(30, 120),
            "fuel_moisture_live_woody": draw.uniform(60, 150),
        }


def crown_witness(bed: Mapping[str, float]) -> tuple[float, float, float, float]:
    """Return kind, rate [m/min], intensity [kW/m] and flame length [m] of pyretechnics' head on a bed.

    Raises:
        ValueError: If the package pyretechnics is not installed.
    """
    burn_cells, cube = _pyretechnics()
    given = {name: value / 100.0 if name in _SHARES else value for name, value in bed.items()}
    given |= {"slope": math.tan(math.radians(bed["slope"])), "wind_speed_10m": 3.6 * bed["wind_speed_10m"]}
    cubes = {name: cube((1, 1, 1), value) for name, value in given.items()}
    fire = burn_cells.burn_cell_as_head_fire(cubes, (0, 0, 0))
    return fire["fire_type"] - 1, fire["spread_rate"], fire["fireline_intensity"], fire["flame_length"]


def of_crowns(
    beds: Mapping[str, np.ndarray],
    layers: Sequence[str] = ("cover", "height", "base_height", "bulk_density"),
    **options: Any,
) -> Spread:
    """Return what ``rate_of_spread`` gives for columns of ``crown_beds``.

    Args:
        beds: Columns by name.
        layers: Of the canopy; without base height and bulk density no crown burns.
        options: Others of ``rate_of_spread``.
    """
    canopy = {name: beds[f"canopy_{name}"] for name in layers} | {"foliar_moisture": beds["foliar_moisture"]}
    water = {name: beds[theirs] for name, theirs in WATER.items()}
    wind = beds["wind_speed_10m"], beds["upwind_direction"]
    ground = beds["fuel_model"], "fbfm40", wind, beds["slope"], beds["aspect"]
    return rate_of_spread(*ground, moisture=water, canopy=canopy, **options)


def _row(quantity: str, ours: np.ndarray, theirs: np.ndarray) -> dict[str, Any]:
    off = np.abs(ours - theirs) / np.maximum(theirs, 1e-4)
    off = np.where((theirs < 1e-4) & (ours < 1e-4), 0.0, off)
    return {
        "quantity": quantity,
        "beds": len(theirs),
        "agree %": f"{100.0 * (off <= _CLOSE).mean():.2f}",
        "largest difference %": f"{100.0 * off.max():.3f}",
    }


def _pyretechnics() -> tuple[Any, Any]:
    try:
        from pyretechnics import burn_cells
        from pyretechnics.space_time_cube import SpaceTimeCube
    except ImportError:
        extra = 'pip install "warp_torchrl[witness]", for Python below 3.13'
        raise ValueError(f"witness needs pyretechnics, which is missing: {extra}") from None
    return burn_cells, SpaceTimeCube
