"""Cost of a prediction by map size: processor time and peak memory of the command."""

import os
import subprocess
import sys
import tempfile
from collections.abc import Sequence
from datetime import datetime, timedelta
from pathlib import Path
from typing import Any

import torch
from torch import Tensor

from warp_torchrl.benchmark.tables import entry, table
from warp_torchrl.system.parent import environment
from warp_torchrl.world.terrain.geotiff import local_grid, write_geotiff

_CELL = 30.0  # [m]
_PATCH = 20  # cells of one fuel, across
_FUELS = (101, 102, 121, 122, 141, 165, 183, 99)  # grass, grass and shrub, shrub, timber, bare (Scott and Burgan 2005)
_LIT = 102
_START = datetime(2024, 7, 1)


def prediction_costs(sides: Sequence[int], hours: int) -> list[dict[str, Any]]:
    """Return the cost of one fire on square maps of hills and mixed fuels, one row per map.

    Args:
        sides: Cells of a side of each map.
        hours: How long the fire is followed.

    Raises:
        ValueError: If a prediction fails, with its last line.
    """
    return [_cost(side, hours) for side in sides]


def prediction_table(rows: Sequence[dict[str, Any]]) -> str:
    """Return the rows of ``prediction_costs`` as a table."""
    return table([entry(heading) for heading in rows[0]], rows)


def _cost(side: int, hours: int) -> dict[str, Any]:
    with tempfile.TemporaryDirectory() as folder:
        _write_case(Path(folder), side, hours)
        process = subprocess.Popen(
            [sys.executable, "-m", "warp_torchrl", "predict", *_arguments(Path(folder))],
            stdout=subprocess.DEVNULL,
            stderr=(Path(folder) / "stderr").open("wb"),
            env={**environment(), "OMP_NUM_THREADS": "1"},
        )
        _, status, used = os.wait4(process.pid, 0)  # of this process alone, and not of all before it
        process.returncode = os.waitstatus_to_exitcode(status)
        if process.returncode:
            raise ValueError((Path(folder) / "stderr").read_text(errors="replace").strip().splitlines()[-1])
    seconds, memory = used.ru_utime + used.ru_stime, used.ru_maxrss * (1 if sys.platform == "darwin" else 1024)
    return {"cells": f"{side} x {side}", "hours": hours, "CPU s": f"{seconds:.0f}", "memory GB": f"{memory / 1e9:.1f}"}


def _arguments(folder: Path) -> list[str]:
    return [
        f"landscape.path={folder}",
        "landscape.fuel=fuel.tif",
        "landscape.elevation=elevation.tif",
        "landscape.table=fbfm40",
        "fire.model=fbfm40",
        f"weather={folder}/weather.csv",
        f"ignition={folder}/ignition.csv",
        "fires=1",
        f"out={folder}/out",
    ]


def _write_case(folder: Path, side: int, hours: int) -> None:
    """Write a map, weather whose wind turns, and a start in the middle."""
    middle, grid = side // 2, local_grid((side, side), _CELL)
    fuel = _mixed(side)
    fuel[middle - _PATCH // 4 : middle + _PATCH // 4, middle - _PATCH // 4 : middle + _PATCH // 4] = _LIT
    write_geotiff(folder / "fuel.tif", {"fuel": fuel}, grid)
    write_geotiff(folder / "elevation.tif", {"elevation": _hills(side)}, grid)
    rows = (f"{_START + timedelta(hours=at):%Y-%m-%d %H:%M},{5 + at % 5},{(250 + 5 * at) % 360}" for at in range(hours))
    (folder / "weather.csv").write_text("\n".join(["datetime,WS,WD", *rows, ""]))
    (folder / "ignition.csv").write_text(f"row,column\n{middle},{middle}\n")


def _mixed(side: int) -> Tensor:
    """Return fuels in square patches, int16 [side, side]."""
    draws = torch.Generator().manual_seed(1)
    patches = torch.randint(len(_FUELS), [side // _PATCH + 1] * 2, generator=draws)
    whole = torch.tensor(_FUELS, dtype=torch.int16)[patches]
    return whole.repeat_interleave(_PATCH, 0).repeat_interleave(_PATCH, 1)[:side, :side].contiguous()


def _hills(side: int) -> Tensor:
    """Return heights, int16 [side, side] [m]."""
    row, column = torch.arange(float(side))[:, None], torch.arange(float(side))[None]
    return (300.0 + 150.0 * torch.sin(row / 37.0) + 120.0 * torch.cos(column / 53.0 + row / 90.0)).to(torch.int16)
