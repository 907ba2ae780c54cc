"""The command score: a predicted fire against what was seen to burn, as tables and a card."""

import json
import logging
import os
from collections.abc import Sequence
from dataclasses import fields
from datetime import datetime
from pathlib import Path

import torch
from torch import Tensor

from warp_torchrl.commands.program import command_help, run_program
from warp_torchrl.prediction.calibration.case import Placed
from warp_torchrl.prediction.calibration.ground import read_fuel
from warp_torchrl.prediction.scores.card import write_card
from warp_torchrl.prediction.scores.null_models import mean_wind
from warp_torchrl.prediction.scores.options import ScoreOptions
from warp_torchrl.prediction.scores.predicted import Predicted, followed_minutes, read_predicted
from warp_torchrl.prediction.scores.report import score_lines, score_numbers
from warp_torchrl.prediction.scores.scoring import Place, fire_scores
from warp_torchrl.prediction.scores.seen import Reading, Seen, read_seen
from warp_torchrl.runs.config.construction import ConfigError, construct
from warp_torchrl.runs.config.grammar import own_values
from warp_torchrl.runs.output import output_folder
from warp_torchrl.system import disk
from warp_torchrl.system.provenance import gathered, section
from warp_torchrl.validation import did_you_mean
from warp_torchrl.world.air.weather import Weather
from warp_torchrl.world.fires.sightings import HotSpotSensor
from warp_torchrl.world.fires.spell import can_ignite, spells_of
from warp_torchrl.world.law.rate import RateFire
from warp_torchrl.world.terrain.cells import check_lies_on, read_cells
from warp_torchrl.world.terrain.grid import Grid
from warp_torchrl.world.weather.dates import read_stamp
from warp_torchrl.world.weather.table import minutes_until, read_weather

log = logging.getLogger("warp_torchrl")

REPORT, CARD = "scores.json", "card.png"
USAGE = "warp score arrival=FILE observed=FILE [observed=[FILE,...]] [KEY=VALUE ...]"
_LISTS = ("observed",)
_TEXTS = ("arrival", "probability", "ignition", "fuel", "weather", "title", "out")
_LONGEST = 1e7  # minutes: what is later is at the end of all times


def main(arguments: Sequence[str] | None = None) -> int:
    """Score the prediction of the command line, and return the exit code."""
    return run_program(arguments, command_help(USAGE, ScoreOptions), _run)


def read_options(arguments: Sequence[str]) -> ScoreOptions:
    """Return the options of a command line.

    Raises:
        ConfigError: If a word is no ``key=value``, or a value does not fit.
    """
    names = [each.name for each in fields(ScoreOptions)]
    values, rest = own_values(arguments, names, _TEXTS)
    if rest:
        key = rest[0].partition("=")[0]
        raise ConfigError(f"{key} is not a key of warp score; it has {', '.join(names)}{did_you_mean(key, names)}")
    for name in _LISTS:
        if isinstance(values.get(name), str):
            values[name] = [values[name]]
    options: ScoreOptions = construct(ScoreOptions, values, "")
    return options


def _run(arguments: Sequence[str]) -> None:
    logging.basicConfig(level=logging.INFO, format="%(message)s")
    options = read_options(arguments)
    folder = Path(options.out or datetime.now().strftime(f"outputs/scores/%Y-%m-%d/%H-%M-%S-{os.getpid()}"))
    with output_folder(folder, "out", overwrite=options.overwrite, last=REPORT, replaced=(CARD, "scores.md")) as draft:
        with gathered() as files:
            predicted = read_predicted(options.arrival, options.probability, options.unit, options.begun)
            seen, times = _seen(options, predicted.grid)
            place = _place(options, predicted.grid, seen[-1].minutes)
        title = options.title or Path(options.observed[0]).resolve().parent.name
        numbers = score_numbers(fire_scores(predicted, seen, times, place), title)
        page = "\n".join([*score_lines(numbers), *section([each.as_values for each in files])])
        _draw(draft / CARD, predicted, seen, numbers)
        numbers |= {"files": [each.as_values for each in files], "configuration": _given(options)}
        disk.replace(draft / REPORT, json.dumps(numbers, indent=1))
        disk.replace(draft / "scores.md", page + "\n")
        written = sorted(each.name for each in draft.iterdir())
    print(page)
    print(f"wrote {', '.join(written)} into {folder}", flush=True)


def _given(options: ScoreOptions) -> dict[str, object]:
    """Return the options that are not their defaults."""
    return {each.name: value for each in fields(options) if (value := getattr(options, each.name)) != each.default}


def _draw(path: Path, predicted: Predicted, seen: Sequence[Seen], numbers: dict[str, object]) -> None:
    try:
        write_card(path, predicted, seen, numbers)
    except ImportError:
        log.warning('no %s: Matplotlib is missing, pip install "warp_torchrl[figures]"', CARD)


def _seen(options: ScoreOptions, grid: Grid) -> tuple[list[Seen], Tensor | None]:
    how = Reading(
        moment=lambda text: _minutes(text, options),
        hours=options.hours,
        sensor=HotSpotSensor(pixel=options.pixel),
        hull=options.hull,
    )
    seen, times = read_seen(options.observed, grid, how)
    followed = followed_minutes(options.arrival) if options.until is None else options.until * 60.0
    kept = seen if followed is None else [each for each in seen if _is_at_end(each) or each.minutes <= followed + 1e-3]
    if not kept:
        raise ValueError(f"observed must hold what was seen by {followed:g} minutes, the first is {seen[0].minutes:g}")
    if len(kept) < len(seen):
        log.info(
            "%d of %d observations are after the prediction's end and are left out", len(seen) - len(kept), len(seen)
        )
    return kept, times


def _is_at_end(each: Seen) -> bool:
    return each.minutes > _LONGEST


def _minutes(text: str, options: ScoreOptions) -> float:
    """Return the minutes from the fire's start to a date and time."""
    what = "the time of what is observed"
    if options.weather is not None:
        return minutes_until(text, options.weather, options.units, what, options.zone) - _start(options)
    begun, moment = (read_stamp(each) for each in (str(options.start), text))
    dated = [each for each in (begun, moment) if each is not None and each.numbers is not None]
    if len(dated) < 2 or len({each.offset is None for each in dated}) > 1:
        rule = "start must be a date and time like those of what is observed, with an offset where they have one"
        raise ValueError(f"{rule}, for {text}; got {options.start}")
    return 60.0 * (dated[1].hours("ymd") - dated[0].hours("ymd"))


def _start(options: ScoreOptions) -> float:
    """Return the fire's start, in minutes after the first row of the weather."""
    if isinstance(options.start, str):
        return minutes_until(options.start, str(options.weather), options.units)
    return options.start


def _place(options: ScoreOptions, grid: Grid, last: float) -> Place | None:
    """Return where the fire started, and over what and in which wind null models grow."""
    if options.ignition is None:
        return None
    lit = torch.from_numpy(read_cells("ignition", options.ignition, grid))
    if options.fuel is None:
        return Place(lit=lit)
    law = RateFire(model=options.model)
    header, ground = read_fuel(Path(options.fuel))
    check_lies_on("fuel", header.grid, grid)
    law.check_fuel(ground)
    wind = None
    if options.weather is not None:
        table = read_weather(options.weather, units=options.units)
        lasts = last if last <= _LONGEST else float(table.hours[-1] - table.hours[0]) * 60.0 + 60.0
        spells = spells_of(Weather(table=table).over(Placed(grid)), lasts, _start(options))  # type: ignore[arg-type]
        wind = mean_wind(torch.stack([each.wind for each in spells]), torch.tensor([each.minutes for each in spells]))
    return Place(lit=lit, fuel=can_ignite(law, ground), wind=wind)
