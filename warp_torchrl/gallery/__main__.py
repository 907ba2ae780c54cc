"""Draws the figures of the world: ``python -m warp_torchrl.gallery [FIGURE ...]``.

All of them by default, as PNG; those of the paper and those that show our laws. It needs the extra ``figures``.
"""

import argparse
import importlib.util
import sys
import time
from collections.abc import Callable, Sequence
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING

from warp_torchrl.gallery.drawing import save, style
from warp_torchrl.gallery.fires import fire_plain, fire_terrain_wind
from warp_torchrl.gallery.landscapes import burn_probability
from warp_torchrl.gallery.laws import ellipses, fire_sizes, isotropy
from warp_torchrl.gallery.terrain import cover, noise, noise_scales
from warp_torchrl.gallery.winds import wind

if TYPE_CHECKING:
    from matplotlib.figure import Figure

WORLD: dict[str, Callable[..., "Figure"]] = {
    "noise": noise,
    "noise_scales": noise_scales,
    "fire_plain": fire_plain,
    "fire_terrain_wind": fire_terrain_wind,
    "wind": wind,
    "cover": cover,
    "isotropy": isotropy,
    "ellipses": ellipses,
    "fire_sizes": fire_sizes,
}
"""Figures that need nothing, by name; a file is named as its figure."""
REAL_GROUND: dict[str, Callable[..., "Figure"]] = {"burn_probability": burn_probability}
"""Figures that need a folder of rasters."""
DONE, MISTAKE = 0, 2


def main(arguments: Sequence[str] | None = None) -> int:
    """Draw what the command line asks for, a line for each figure, and return the exit code."""
    options = _parser().parse_args(arguments)
    if options.list:
        print("\n".join(f"{name:<20}{_first_line(draw)}" for name, draw in (WORLD | REAL_GROUND).items()))
        return DONE
    mistake = _mistake(options)
    if mistake is None:
        try:
            _draw_all(options)
        except (ValueError, OSError) as error:  # of a folder of rasters, or of the one to write to
            mistake = " ".join(str(error).split())
    if mistake is not None:
        print(f"gallery: {mistake}", file=sys.stderr)
        return MISTAKE
    return DONE


def _parser() -> argparse.ArgumentParser:
    parser = argparse.ArgumentParser(prog="python -m warp_torchrl.gallery", description=__doc__.splitlines()[0])
    parser.add_argument("figures", nargs="*", metavar="FIGURE", help="all by default; --list names them")
    parser.add_argument("--list", action="store_true", help="print what there is to draw")
    parser.add_argument("--out", type=Path, default=Path("docs/figures"), metavar="FOLDER", help="%(default)s")
    parser.add_argument("--landscape", type=Path, metavar="FOLDER", help="rasters for the figures of real ground")
    return parser


def _mistake(options: argparse.Namespace) -> str | None:
    """Return what is wrong with the command line or the installation."""
    unknown = [name for name in options.figures if name not in WORLD | REAL_GROUND]
    if unknown:
        return f"figure must be one of {', '.join(WORLD | REAL_GROUND)}, got {unknown[0]}"
    if options.landscape is not None and not options.landscape.is_dir():
        return f"landscape must be a folder of rasters that exists, got {options.landscape}"
    if importlib.util.find_spec("matplotlib") is None:
        return 'figures need Matplotlib: pip install "warp_torchrl[figures]"'
    return None


def _draw_all(options: argparse.Namespace) -> None:
    ready, missing = dict(WORLD), REAL_GROUND
    if options.landscape is not None:
        ready |= {name: partial(draw, options.landscape) for name, draw in REAL_GROUND.items()}
        missing = {}
    for name in options.figures or WORLD | REAL_GROUND:
        if name in missing:
            print(f"{name:<20} skipped: it needs --landscape FOLDER, a folder of rasters")
            continue
        start = time.perf_counter()
        path = draw_figure(ready[name], options.out / f"{name}.png")
        print(f"{name:<20}{time.perf_counter() - start:6.1f} s  {path}", flush=True)


def draw_figure(draw: Callable[[], "Figure"], path: Path) -> Path:
    """Draw a figure and write it as PNG; its folder is made where it is missing."""
    path.parent.mkdir(parents=True, exist_ok=True)
    with style():
        save(draw(), path)
    return path


def _first_line(draw: Callable[..., "Figure"]) -> str:
    return draw.__doc__.splitlines()[0]


if __name__ == "__main__":
    sys.exit(main())
