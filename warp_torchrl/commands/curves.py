"""The command curves: learning curves and tables of runs."""

import argparse
import math
from collections.abc import Callable, Sequence
from pathlib import Path

from warp_torchrl.commands.failure import DONE, fail
from warp_torchrl.commands.program import flag_arguments, one_line_end
from warp_torchrl.env.pictures.files import check_matplotlib, draw_timed
from warp_torchrl.evaluation.runs import kinds, reached, saved_at
from warp_torchrl.evaluation.runs.curves import curve_figures, lines_of
from warp_torchrl.runs.checkpoint import CheckpointError
from warp_torchrl.system.flags import FlagParser

_USAGE = "curves [NAME=]RUN [[NAME=]RUN ...] [--out FOLDER]"


@one_line_end()
def main(arguments: Sequence[str] | None = None) -> int:
    """Draw the learning curves of the runs that the command line names, and return the exit code."""
    try:
        _draw(_parser().parse_args(flag_arguments(arguments)))
    except (ValueError, OSError, CheckpointError) as error:  # of the command line, or of a folder to read or write
        return fail(error, debug=False)[0]
    return DONE


def _draw(options: argparse.Namespace) -> None:
    if not options.runs:
        raise ValueError(f"give the folder of at least one run: {_USAGE}")
    check_matplotlib()
    lines = lines_of([_named(given) for given in options.runs])
    tables = [reached.reached_table(lines, options.reach)] if options.reach else []
    tables += [saved_at.saved_table(lines, options.at)] if options.at else []  # refuses steps that a run has not made
    tables += [kinds.kinds_table(lines)] if options.kinds else []
    for name, draw in curve_figures(lines).items():
        draw_timed(name, draw, options.out)
    print(*tables, sep="\n\n", end="\n" if tables else "")


def _levels(given: str) -> list[float]:
    return _numbers(given, lambda level: 0.0 <= level <= 100.0, "percentages in 0..100")


def _steps(given: str) -> list[float]:
    return _numbers(given, lambda step: step >= 1.0 and step.is_integer(), "world steps, whole numbers from 1 on")


def _numbers(given: str, fits: Callable[[float], bool], what: str) -> list[float]:
    """Return numbers that stand between commas.

    Raises:
        argparse.ArgumentTypeError: If they are none, or do not fit.
    """
    try:
        numbers = [float(each) for each in given.split(",")]
    except ValueError:
        numbers = [math.nan]
    if not all(fits(number) for number in numbers):
        raise argparse.ArgumentTypeError(f"must be {what}, got {given}")
    return numbers


def _named(given: str) -> tuple[str, Path]:
    """Return the name of some runs, and their folder, which may have the sign in its path."""
    name, sign, folder = given.partition("=")
    return (name, Path(folder)) if sign and not Path(given).exists() else ("", Path(given))


def _parser() -> argparse.ArgumentParser:
    about = (
        "Draws the learning curves of runs: curves_single.png of those with one agent, curves_multi.png of the others, "
        "curves_saved.png of all. Runs that differ in their seed alone are one line, with a band."
    )
    parser = FlagParser(prog="warp curves", description=about)
    parser.add_argument(
        "runs", nargs="*", metavar="[NAME=]RUN", help="folder of a run, or of a sweep, and what to call its runs"
    )
    parser.add_argument(
        "--out", type=Path, default=Path(), metavar="FOLDER", help="where to write, the current folder by default"
    )
    parser.add_argument(
        "--reach", type=_levels, default=(), metavar="PERCENT,...", help="print when runs first save so much forest"
    )
    parser.add_argument(
        "--at",
        type=_steps,
        default=(),
        metavar="STEPS,...",
        help="print the forest saved in training by these world steps, each the mean over the twentieth of the run "
        "before it, the median of world steps a second, and minutes",
    )
    parser.add_argument(
        "--kinds",
        action="store_true",
        help="print the forest saved in the last evaluation in training, of a mixture by kind, and the differences to "
        "the first runs, seed by seed",
    )
    return parser
