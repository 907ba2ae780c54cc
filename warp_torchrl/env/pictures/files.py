"""Figures as files."""

import importlib.util
import time
from collections.abc import Callable
from pathlib import Path
from typing import TYPE_CHECKING

from warp_torchrl.env.pictures.drawing import save_figure, style

if TYPE_CHECKING:
    from matplotlib.figure import Figure


def check_matplotlib() -> None:
    """Check that figures can be drawn.

    Raises:
        ValueError: If Matplotlib is not installed.
    """
    if importlib.util.find_spec("matplotlib") is None:
        raise ValueError('figures need Matplotlib: pip install "warp_torchrl[figures]"')


def draw_figure(draw: Callable[[], "Figure"], path: Path) -> Path:
    """Draw a figure and write it as PNG; a missing folder is made."""
    path.parent.mkdir(parents=True, exist_ok=True)
    with style():
        save_figure(draw(), path)
    return path


def draw_timed(name: str, draw: Callable[[], "Figure"], folder: Path) -> None:
    """Draw a figure into a folder, and print its name, the time that it took, and its path."""
    start = time.perf_counter()
    path = draw_figure(draw, folder / f"{name}.png")
    print(f"{name:<20}{time.perf_counter() - start:6.1f} s  {path}", flush=True)
