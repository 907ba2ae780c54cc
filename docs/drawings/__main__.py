"""Draws the figures of the world: ``python docs/drawings [FIGURE ...]``.

All of them by default, as PNG, and animations as WebP; those of the paper and those that show our laws. They need the
extra ``figures``.
``python docs/drawings episode`` photographs a team at work; it needs the extra ``live``, Playwright and Chromium.
"""

import argparse
import sys
import time
from collections.abc import Callable, Sequence
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING

sys.path.insert(0, str(Path(__file__).parents[1]))  # of this package

from drawings.belief import belief, scouts
from drawings.embers import embers
from drawings.episode import photograph
from drawings.fires import fire_plain, fire_terrain_wind
from drawings.hills import hills
from drawings.house import house
from drawings.landscapes import burn_probability
from drawings.laws import burned_by_wind, ellipses, fire_sizes, isotropy
from drawings.terrain import cover, noise, noise_scales
from drawings.winds import wind
from warp_torchrl.commands.failure import DONE, fail
from warp_torchrl.commands.program import one_line_end
from warp_torchrl.env.pictures.files import check_matplotlib, draw_timed
from warp_torchrl.live.match import Setting
from warp_torchrl.runs.checkpoint import CheckpointError
from warp_torchrl.runs.config.grammar import check_overrides
from warp_torchrl.runs.config.seeds import FIRST_EVALUATED
from warp_torchrl.system.flags import FlagParser

if TYPE_CHECKING:
    from matplotlib.figure import Figure

WORLD: dict[str, Callable[..., "Figure"]] = {
    "noise": noise,
    "noise_scales": noise_scales,
    "fire_plain": fire_plain,
    "fire_terrain_wind": fire_terrain_wind,
    "wind": wind,
    "hills": hills,
    "embers": embers,
    "cover": cover,
    "isotropy": isotropy,
    "ellipses": ellipses,
    "burned_by_wind": burned_by_wind,
    "fire_sizes": fire_sizes,
    "house": house,
    "belief": belief,
}
"""Figures that need nothing, by name; a file is named as its figure."""
FILMS: dict[str, Callable[[Path], None]] = {"scouts": scouts}
"""Animations that need nothing, WebP, by name."""
REAL_GROUND: dict[str, Callable[..., "Figure"]] = {"burn_probability": burn_probability}
"""Figures that need a folder of rasters."""
_EPISODE = "episode [--policy NAME] [--seed SEED] [--steps FIRST:LAST:EVERY] [--out FOLDER] [KEY=VALUE ...]"


@one_line_end()
def main(arguments: Sequence[str] | None = None) -> int:
    """Draw what the command line asks for, a line for each figure, and return the exit code."""
    given = list(sys.argv[1:] if arguments is None else arguments)
    try:
        if given[:1] == ["episode"]:
            _episode(given[1:])
        else:
            _world(given)
    except (ValueError, OSError, CheckpointError) as error:  # of the command line, or of a folder to read or write
        return fail(error, debug=False)[0]
    return DONE


def _world(arguments: Sequence[str]) -> None:
    options = _parser().parse_args(arguments)
    if options.list:
        print("\n".join(f"{name:<20}{_first_line(draw)}" for name, draw in (WORLD | FILMS | REAL_GROUND).items()))
        print(f"{_EPISODE} photographs a team at work")
        return
    _check(options)
    _draw_all(options)


def _episode(arguments: Sequence[str]) -> None:
    options = _episode_parser().parse_intermixed_args(arguments)
    check_overrides(options.overrides)
    setting = Setting(policy=options.policy, seed=options.seed, overrides=tuple(options.overrides))
    start = time.perf_counter()
    first, last, every = options.steps
    path = photograph(setting, first, last, every, options.out / "episode", options.sharpness)
    print(f"{'episode':<20}{time.perf_counter() - start:6.1f} s  {path}", flush=True)


def _three_steps(given: str) -> tuple[int, int, int]:
    """Return the first and the last step, and the distance between pictures.

    Raises:
        argparse.ArgumentTypeError: If they are none.
    """
    words = given.split(":")
    if not (1 <= len(words) <= 3 and all(word.isdecimal() for word in words)):
        raise argparse.ArgumentTypeError(f"must be FIRST, FIRST:LAST or FIRST:LAST:EVERY, whole numbers, got {given}")
    first = int(words[0])
    last = int(words[1]) if len(words) > 1 else first
    every = int(words[2]) if len(words) > 2 else 1
    if last < first or every < 1:
        raise argparse.ArgumentTypeError(f"must go on from the first step, by at least one at a time, got {given}")
    return first, last, every


def _parser() -> argparse.ArgumentParser:
    parser = FlagParser(prog="python docs/drawings", description=" ".join(__doc__.split()))
    parser.add_argument("figures", nargs="*", metavar="FIGURE", help="all by default; --list names them")
    parser.add_argument("--list", action="store_true", help="print what there is to draw")
    parser.add_argument("--out", type=Path, default=Path("docs/figures"), metavar="FOLDER", help="%(default)s")
    parser.add_argument("--landscape", type=Path, metavar="FOLDER", help="rasters for the figures of real ground")
    return parser


def _episode_parser() -> argparse.ArgumentParser:
    about = (
        "Plays an episode and photographs it in Chromium: of one step episode.png, of several episode.webp. Overrides "
        "are those of train.py."
    )
    parser = FlagParser(prog="python docs/drawings episode", description=about)
    parser.add_argument("overrides", nargs="*", metavar="KEY=VALUE", help="of the scenario, landscape.relief=120")
    parser.add_argument("--policy", default="default", metavar="NAME", help="baseline, shipped policy or run folder")
    parser.add_argument("--seed", type=int, default=FIRST_EVALUATED, help="of the fire, %(default)s by default")
    parser.add_argument(
        "--steps", type=_three_steps, default=(0, 512, 2), metavar="FIRST:LAST:EVERY", help="by default all, 0:512:2"
    )
    parser.add_argument("--out", type=Path, default=Path("docs/figures"), metavar="FOLDER", help="%(default)s")
    parser.add_argument(
        "--sharpness", type=float, default=1.0, help="pixels for one of 900 x 580, in 0.2..4, %(default)s by default"
    )
    return parser


def _check(options: argparse.Namespace) -> None:
    """Refuse what is wrong with the command line or the installation."""
    unknown = [name for name in options.figures if name not in WORLD | FILMS | REAL_GROUND]
    if unknown:
        raise ValueError(f"figure must be one of {', '.join(WORLD | FILMS | REAL_GROUND)}, got {unknown[0]}")
    if options.landscape is not None and not options.landscape.is_dir():
        raise ValueError(f"landscape must be a folder of rasters that exists, got {options.landscape}")
    check_matplotlib()


def _draw_all(options: argparse.Namespace) -> None:
    ready, missing = dict(WORLD), REAL_GROUND
    if options.landscape is not None:
        ready |= {name: partial(draw, options.landscape) for name, draw in REAL_GROUND.items()}
        missing = {}
    for name in options.figures or WORLD | FILMS | REAL_GROUND:
        if name in missing:
            print(f"{name:<20} skipped: it needs --landscape FOLDER, a folder of rasters")
            continue
        if name in FILMS:
            _film(name, options.out)
        else:
            draw_timed(name, ready[name], options.out)


def _film(name: str, folder: Path) -> None:
    start, path = time.perf_counter(), folder / f"{name}.webp"
    folder.mkdir(parents=True, exist_ok=True)
    FILMS[name](path)
    print(f"{name:<20}{time.perf_counter() - start:6.1f} s  {path}", flush=True)


def _first_line(draw: Callable[..., object]) -> str:
    return str(draw.__doc__).splitlines()[0]


if __name__ == "__main__":
    sys.exit(main())
