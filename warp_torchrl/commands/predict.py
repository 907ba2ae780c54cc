"""The command predict: fires without vehicles on one map, in hourly weather, as maps and a report."""

import json
import logging
import os
import time
from collections.abc import Mapping, Sequence
from dataclasses import fields, replace
from datetime import datetime
from pathlib import Path
from typing import Any

import torch
from tqdm import tqdm

from warp_torchrl.commands.program import PLUGINS, command_help, run_program
from warp_torchrl.prediction.animation import write_animation
from warp_torchrl.prediction.case import Case, read_case, whole_map
from warp_torchrl.prediction.files import (
    ARRIVALS,
    MAPS_FIGURE,
    write_arrivals,
    write_figure,
    write_layers,
    write_perimeters,
)
from warp_torchrl.prediction.observed.correction import Corrected, Correction
from warp_torchrl.prediction.observed.observation import Observation
from warp_torchrl.prediction.observed.reading import read_observations
from warp_torchrl.prediction.observed.report import (
    FIGURE,
    SCORES,
    observed_lines,
    observed_numbers,
    write_observed_figure,
    write_scores,
)
from warp_torchrl.prediction.observed.scene import Scene
from warp_torchrl.prediction.predict import Prediction, lasting, predict
from warp_torchrl.prediction.report import page, report_numbers, warnings
from warp_torchrl.runs.config.construction import ConfigError, build, construct
from warp_torchrl.runs.config.options import PredictionOptions
from warp_torchrl.runs.config.plain_values import without_targets
from warp_torchrl.runs.config.prediction import compose_prediction
from warp_torchrl.runs.output import output_folder
from warp_torchrl.system import disk, memory
from warp_torchrl.system.provenance import Provenance, gathered
from warp_torchrl.world.air.files import minutes_in
from warp_torchrl.world.air.weather import Weather
from warp_torchrl.world.arrays.random import world_key
from warp_torchrl.world.ensemble.parameters import Deviations
from warp_torchrl.world.fires.members import Members
from warp_torchrl.world.law.rate import RateFire
from warp_torchrl.world.terrain.raster import Raster

log = logging.getLogger("warp_torchrl")

_APART = ("landscape", "fire", "plugins")
REPORT = "report.json"
OUTPUTS = (
    *("burn_probability.tif", "arrival_hours.tif", "rate.tif", "intensity.tif", "flame_length.tif", "crown.tif"),
    *(ARRIVALS, "perimeters.geojson", MAPS_FIGURE, "fire.gif", "report.md", FIGURE, SCORES),
)
"""What an earlier prediction may have left, beside its report."""
_OTHERS = "landscape.KEY and fire.KEY: warp keys landscape fire"
USAGE = "warp predict landscape.path=FOLDER weather=FILE.csv ignition=FILE [hours=24] [fires=1000] [KEY=VALUE ...]"


def main(arguments: Sequence[str] | None = None) -> int:
    """Predict the fires of the command line, and return the exit code."""
    about = command_help(USAGE, PredictionOptions, more=(PLUGINS, _OTHERS))
    return run_program(arguments, about, _run)


def _run(arguments: Sequence[str]) -> None:
    began, program = time.perf_counter(), memory.most_used()
    logging.basicConfig(level=logging.INFO, format="%(message)s")
    values = compose_prediction(arguments)
    options: PredictionOptions = construct(
        PredictionOptions, {key: value for key, value in values.items() if key not in _APART}, ""
    )
    folder = Path(options.out or datetime.now().strftime(f"outputs/predictions/%Y-%m-%d/%H-%M-%S-{os.getpid()}"))
    with output_folder(folder, "out", overwrite=options.overwrite, last=REPORT, replaced=OUTPUTS) as draft:
        with gathered() as files:
            case = read_case(_landscape(values["landscape"]), _law(values["fire"]), options)
            seen = _observations(case, options)
        fires_began = time.perf_counter()
        corrected = _correct(case, options, seen) if seen else None
        prediction = _burn(case, options, corrected)
        seconds = {"fires": time.perf_counter() - fires_began, "all": time.perf_counter() - began}
        report = _report(prediction, case, values, files, seconds)
        _write(draft, prediction, case, options, report["title"])
        report["gigabytes"] = {"most": memory.most_used() / 1e9, "program": program / 1e9, "map": _bytes(case) / 1e9}
        text = page(report)
        if corrected is not None:
            report["observed"] = observed_numbers(corrected, case.cell_size)
            text += "\n" + "\n".join(observed_lines(report["observed"])) + "\n"
            _write_observed(draft, report)
        report["seconds"]["all"] = time.perf_counter() - began
        disk.replace(draft / REPORT, json.dumps(report, indent=1))
        disk.replace(draft / "report.md", text)
        written = sorted(each.name for each in draft.iterdir())
    print(text)
    print(f"wrote {', '.join(written)} into {folder}", flush=True)


def _landscape(node: Mapping[str, Any]) -> Any:
    """Return the landscape; of rasters the whole map, unless a window is named."""
    if not node["_target_"].endswith(".Raster"):
        return build(node, "landscape")
    if node["size"] is not None:
        if node["row"] is None or node["column"] is None:
            raise ConfigError("landscape.row and landscape.column must be given with landscape.size, got null")
        return build(node, "landscape")
    smallest: Raster = build({**node, "size": 4, "row": None, "column": None, "min_fuel": 0.0}, "landscape")
    try:
        return whole_map(smallest)
    except ValueError as error:
        raise ConfigError(f"landscape.{error}") from None


def _law(node: Mapping[str, Any]) -> RateFire:
    """Return the law of the fire, which must be one in metres and minutes."""
    law = build(node, "fire")
    if not isinstance(law, RateFire):
        raise ConfigError(f"fire must be a law of metres and minutes, rate, got {node['_target_'].rpartition('.')[2]}")
    return law


def _observations(case: Case, options: PredictionOptions) -> list[Observation]:
    """Return what was seen of the fire on the way; none where no file is named."""
    if options.observed is None:
        return []

    def moment(text: str) -> float:
        path, zone = str(options.weather), options.observed_zone
        return minutes_in(path, text, options.units, "the time of what is observed", zone) - case.start

    height, width = case.ignition.shape
    end = _minutes(case, options)
    return read_observations(options.observed, case.place.grid, case.place.corner, (height, width), moment, end)


def _minutes(case: Case, options: PredictionOptions) -> float:
    """Return for how long fires are followed."""
    return lasting(case.weather, case.start) if options.hours is None else 60.0 * options.hours


def _correct(case: Case, options: PredictionOptions, seen: Sequence[Observation]) -> Corrected:
    """Return what was learned from observations, behind a progress bar."""
    scene = Scene(
        ground=case.ground,
        cell_size=case.cell_size,
        fire=case.fire,
        air=Weather(table=case.weather, convergence=case.convergence, fields=case.fields, sunlight=case.sunlight),
        start=case.start,
        lit=case.ignition,
        gusts=options.gustiness if options.gusts else None,
    )
    correction = Correction(
        members=options.fires, deviations=_deviations(case, options), sensor=options.hot_spots, seed=options.seed
    )
    with tqdm(total=len(seen), unit="observation", disable=None, dynamic_ncols=True) as bar:
        return correction(scene, seen, bar.update)


def _members(case: Case, options: PredictionOptions) -> Members | None:
    """Return by what fires differ from the ignition on, in rate, wind and moisture; None where they do not."""
    if options.uncertain == "none" or options.fires == 1:
        return None
    keys, deviations = world_key(options.seed + torch.arange(options.fires)), _deviations(case, options)
    if options.uncertain == "rate":
        return Members.by_rate(keys, deviations.rate)
    return Members.drawn(keys, deviations, case.ignition)


def _deviations(case: Case, options: PredictionOptions) -> Deviations:
    """Return how far fires differ, with the law's ``fire_deviation`` as that of the rate where it has one."""
    rate = case.fire.fire_deviation
    return replace(options.members, rate=rate) if rate else options.members


def _burn(case: Case, options: PredictionOptions, corrected: Corrected | None) -> Prediction:
    """Burn the fires behind a progress bar: from the ignition, or from what was last seen."""
    begun = 0.0 if corrected is None else corrected.minutes
    members = _members(case, options) if corrected is None else corrected.members
    with tqdm(total=options.fires, unit="fire", disable=None, dynamic_ncols=True) as bar:
        return predict(
            case.ground,
            case.weather,
            case.ignition if corrected is None else corrected.burned,
            fire=case.fire if members is None else case.fire.alike(),
            cell_size=case.cell_size,
            hours=options.hours if corrected is None else (_minutes(case, options) - begun) / 60.0,
            area=options.area,
            fires=options.fires,
            seed=options.seed,
            start=case.start + begun,
            convergence=case.convergence,
            fields=case.fields,
            sunlight=case.sunlight,
            gusts=options.gustiness if options.gusts else None,
            members=members,
            is_seen=corrected is not None,
            embers=options.firebrands if options.embers else None,
            later=case.later,
            keep_every=options.arrivals,
            progress=bar.update,
        )


def _report(
    prediction: Prediction,
    case: Case,
    values: Mapping[str, Any],
    files: Sequence[Provenance],
    seconds: dict[str, float],
) -> dict[str, Any]:
    from warp_torchrl import __version__

    found, lack = report_numbers(prediction), case.fire.bed.lack_of_canopy(case.ground)
    told = (each.name for each in fields(case.weather) if each.name not in ("began", "zone"))
    known = [name for name in told if getattr(case.weather, name) is not None]
    inputs = {
        "landscape": values["landscape"].get("path"),
        "map": f"{case.ignition.shape[0]} x {case.ignition.shape[1]} cells of {case.cell_size:g} m",
        "crs": str(case.place.grid.crs) if case.place.grid.crs else None,
        "weather": values["weather"],
        "weather tells": known,
        "wind height": case.weather.wind_height,
        "grid convergence [degrees]": round(case.convergence, 3),
        "start [minutes after the first row]": case.start,
        "ignition": f"{values['ignition']}, {int(prediction.lit.sum())} cells with fuel of {_marked(case)}",
        **_barriers(case, values),
        "cells of fuels": case.fire.told_fuel(case.ground),
        **({"season": case.season} if case.season else {}),
        **dict(each.split(": ", 1) for each in case.files),
        "law": without_targets(values["fire"]),
    }
    return {
        "title": f"Prediction from {values['landscape'].get('path') or 'a map'}",
        "version": __version__,
        **found,
        "warnings": [*warnings(found, lasting(case.weather, case.start)), *([lack] if lack else [])],
        "inputs": inputs,
        "files": [each.as_values for each in files],
        "configuration": without_targets(values),
        "seconds": seconds,
    }


def _bytes(case: Case) -> int:
    """Return the bytes of the map's layers."""
    return sum(leaf.numel() * leaf.element_size() for leaf in case.ground.leaves().values())


def _marked(case: Case) -> int:
    """Return how many cells the ignition marks."""
    return int((case.ignition if case.later is None else case.ignition | case.later.isfinite()).sum())


def _barriers(case: Case, values: Mapping[str, Any]) -> dict[str, str]:
    """Return what is read of barriers; nothing where there are none."""
    if case.closed is None:
        return {}
    return {"barriers": f"{values['barriers']}, {int(case.closed.sum())} cells that no fire enters"}


def _write(folder: Path, prediction: Prediction, case: Case, options: PredictionOptions, title: str) -> None:
    """Write the maps; without Matplotlib all but the figure."""
    write_layers(folder, prediction, case.place)
    if options.arrivals:
        write_arrivals(folder / ARRIVALS, prediction, case.place)
    write_perimeters(folder / "perimeters.geojson", prediction, case.place, options.perimeter_hours)
    try:
        write_figure(folder / MAPS_FIGURE, prediction, title)
    except ImportError:
        log.warning('no %s: Matplotlib is missing, pip install "warp_torchrl[figures]"', MAPS_FIGURE)
    if options.animation:
        end = float(prediction.followed[0])
        first, ground = prediction.seen["first_fire"], prediction.ground_seen
        write_animation(folder / "fire.gif", first, ground, case.cell_size, end, case.fire.residence)


def _write_observed(folder: Path, report: Mapping[str, Any]) -> None:
    """Write the scores of forecasts; without Matplotlib all but the figure."""
    write_scores(folder / SCORES, report["observed"])
    try:
        write_observed_figure(folder / FIGURE, report["observed"], report["title"])
    except ImportError:
        log.warning('no %s: Matplotlib is missing, pip install "warp_torchrl[figures]"', FIGURE)
