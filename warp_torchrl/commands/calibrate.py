"""The command calibrate: scores of the law on real fires, beside null models, and fits of its parameters."""

import json
import logging
import os
import time
from collections.abc import Callable, Mapping, Sequence
from datetime import datetime
from pathlib import Path
from typing import Any

from warp_torchrl.commands.program import PLUGINS, command_help, run_program
from warp_torchrl.prediction.calibration.case import FireCase, read_fire_case
from warp_torchrl.prediction.calibration.fitting import (
    SHARES,
    Shrinkage,
    check_fuel_codes,
    check_not_in_weather,
    folds,
    null_scores,
    score,
    shrinkage,
)
from warp_torchrl.prediction.calibration.options import CalibrationOptions
from warp_torchrl.prediction.calibration.parameters import Parameter, fire_at, parameters_of
from warp_torchrl.prediction.calibration.report import ScoreLog, as_numbers, law_yaml, means, scores_table
from warp_torchrl.prediction.scores.scar import Scores
from warp_torchrl.runs.config.compose import compose_config
from warp_torchrl.runs.config.construction import ConfigError, build, construct
from warp_torchrl.runs.config.grammar import check_flags
from warp_torchrl.runs.config.plain_values import plain, without_targets
from warp_torchrl.runs.output import output_folder
from warp_torchrl.system import disk
from warp_torchrl.system.provenance import Provenance, gathered, report_file, section
from warp_torchrl.world.law.rate import RateFire
from warp_torchrl.world.terrain.layers import CanopyUnits

log = logging.getLogger("warp_torchrl")

REPORT = "calibration.json"
USAGE = "warp calibrate fires=[FOLDER,...] [parameters=[rate_gain,...]] [KEY=VALUE ...]"
LAW = "fire/calibrated.yaml"
"""In the folder that the command writes, so that ``--config-dir`` takes that folder."""
LOG = "scores.log"
"""In the folder too: a line of JSON for each score, written as soon as it is known."""
OUTPUTS = (LAW, "calibration.md")
"""What an earlier calibration may have left, beside its report."""


def main(arguments: Sequence[str] | None = None) -> int:
    """Score and fit on the command line's fires, and return the exit code."""
    about = command_help(USAGE, CalibrationOptions, more=(PLUGINS, "fire.KEY: warp keys fire"))
    return run_program(arguments, about, _run)


def _run(arguments: Sequence[str]) -> None:
    began = time.perf_counter()
    logging.basicConfig(level=logging.INFO, format="%(message)s")
    check_flags(arguments)
    values = plain(compose_config("calibrate", arguments))
    options: CalibrationOptions = construct(
        CalibrationOptions, {key: value for key, value in values.items() if key not in ("fire", "plugins")}, ""
    )
    fire = _law(values["fire"])
    parameters = parameters_of(options.parameters, fire, options.bounds, options.scales)
    folder = Path(options.out or datetime.now().strftime(f"outputs/calibrations/%Y-%m-%d/%H-%M-%S-{os.getpid()}"))
    with output_folder(folder, "out", overwrite=options.overwrite, last=REPORT, replaced=OUTPUTS) as draft:
        with gathered() as files:
            canopy = CanopyUnits(options.height_unit, options.density_unit)
            cases = [read_fire_case(each, options.hours_of(each), options.units, canopy) for each in options.fires]
            for case in cases:
                check_fuel_codes(case, fire)
                report_file(_of_map(case, fire))
                if lack := fire.bed.lack_of_canopy(case.landscape):
                    log.warning("%s: %s", case.name, lack)
        _check_names(cases)
        check_not_in_weather(parameters, cases)
        rows = ScoreLog(folder / LOG, [case.name for case in cases])
        for case in cases:
            for name, scores in _before(fire, case, options).items():
                rows.add(case.name, name, scores)
        law, kept = _fit(fire, parameters, cases, rows, options) if parameters else (None, None)
        page = _write(draft, rows.scores, values, files, law, parameters, kept, time.perf_counter() - began)
        written = sorted(each.name for each in draft.iterdir())
    print(page)
    print(f"wrote {', '.join(written)} into {folder}, in {time.perf_counter() - began:.0f} s", flush=True)


def _law(node: Mapping[str, Any]) -> RateFire:
    """Return the law, which must be one in metres and minutes."""
    law = build(node, "fire")
    if not isinstance(law, RateFire):
        raise ConfigError(f"fire must be a law of metres and minutes, rate, got {node['_target_'].rpartition('.')[2]}")
    return law


def _check_names(cases: Sequence[FireCase]) -> None:
    names = [case.name for case in cases]
    if len(set(names)) < len(names):
        raise ConfigError(f"fires must have different names, got {', '.join(names)}")


def _of_map(case: FireCase, fire: RateFire) -> Provenance:
    """Return the files of a fire's map, and the number of cells of each fuel."""
    notes = (*case.files, f"cells of fuels: {fire.told_fuel(case.landscape)}")
    return Provenance(key=case.name, file="map", notes=notes)


def _before(fire: RateFire, case: FireCase, options: CalibrationOptions) -> dict[str, Scores]:
    return null_scores(fire, case) | {"uncalibrated": score(fire, case, options.draws, options.seed)}


def _fit(
    fire: RateFire,
    parameters: Sequence[Parameter],
    cases: Sequence[FireCase],
    rows: ScoreLog,
    options: CalibrationOptions,
) -> tuple[RateFire, Shrinkage]:
    """Fit to all fires but one in turn, and to all; score each; return the law and the share of the fit that it has."""
    tried = options.leave_one_out and len(cases) > 1
    kept = _shrinkage(fire, parameters, cases, rows, options) if tried else Shrinkage(1.0)
    log.info("%s", kept)
    moved = options.fit(fire, parameters, cases, _progress("all fires"))
    law = fire_at(fire, parameters, kept.share * moved)
    for case in cases:
        rows.add(case.name, "fitted", score(law, case, options.draws, options.seed))
    return law, kept


def _shrinkage(
    fire: RateFire,
    parameters: Sequence[Parameter],
    cases: Sequence[FireCase],
    rows: ScoreLog,
    options: CalibrationOptions,
) -> Shrinkage:
    """Return the share of the fit that is best on fires left out; score each fire by the share of the others."""
    found: dict[str, dict[float, Scores]] = {}
    for left_out, others in folds(cases):
        moved = options.fit(fire, parameters, others, _progress(f"without {left_out.name}"))
        laws = {share: fire_at(fire, parameters, share * moved) for share in SHARES[1:]}
        tried = {share: score(law, left_out, options.draws, options.seed) for share, law in laws.items()}
        found[left_out.name] = {SHARES[0]: rows.scores[left_out.name]["uncalibrated"], **tried}
        rows.add(left_out.name, "left out, whole fit", tried[1.0])
    for name, tried in found.items():
        rows.add(name, "left out", tried[shrinkage([each for other, each in found.items() if other != name]).share])
    return shrinkage(list(found.values()))


def _progress(fires: str) -> Callable[[int, float], None]:
    return lambda step, loss: log.info("%s: step %d, loss %.4f", fires, step, loss)


def _write(
    folder: Path,
    rows: Mapping[str, Mapping[str, Scores]],
    values: Mapping[str, Any],
    files: Sequence[Provenance],
    law: RateFire | None,
    parameters: Sequence[Parameter],
    kept: Shrinkage | None,
    seconds: float,
) -> str:
    """Write the report into a folder, and return its page."""
    from warp_torchrl import __version__

    found = {each.name: each.usual(law) for each in parameters} if law else {}
    report = {
        "version": __version__,
        "parameters": found,
        "share": kept and kept.share,
        "left_out": kept and {"gain": kept.gain, "error": kept.error, "fires": kept.fires},
        "scores": as_numbers(rows),
        "means": means(rows),
        "files": [each.as_values for each in files],
        "configuration": without_targets(values),
        "seconds": seconds,
    }
    disk.replace(folder / REPORT, json.dumps(report, indent=1))
    page = scores_table(rows)
    if law is not None:
        (folder / LAW).parent.mkdir(exist_ok=True)
        disk.replace(folder / LAW, law_yaml(law, f"Law rate, fitted to {', '.join(rows)}."))
        page += "\n\n" + "\n".join(f"{name}: {value:.4g}" for name, value in found.items())
        page += f"\n{kept}"
    page = "\n".join([page, *section([each.as_values for each in files])])
    disk.replace(folder / "calibration.md", page + "\n")
    return page
