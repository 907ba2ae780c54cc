"""Report of a prediction: JSON, Markdown and lines for a terminal."""

from collections.abc import Mapping
from typing import Any

import torch
from torch import Tensor

from warp_torchrl.prediction.predict import Prediction
from warp_torchrl.system.provenance import section

_ROWS = 25  # of the table of hours


def report_numbers(prediction: Prediction) -> dict[str, Any]:
    """Return the numbers of a prediction as plain values: areas [ha], metres, minutes, kW/m."""
    area, progress = prediction.area, prediction.progress
    hours = [
        {
            "hour": float(hour),
            "area_ha": _spread(area[:, step]),
            "head_m": _spread(progress[:, step]),
        }
        for step, hour in enumerate(prediction.hours.tolist())
    ]
    rates = {name: _highest(getattr(prediction, name)) for name in ("rate", "intensity", "flame_length")}
    return {
        "fires": len(prediction.followed),
        "at_once": prediction.at_once,
        "followed_minutes": _spread(prediction.followed),
        "area_ha": _spread(prediction.final_area),
        "left_map": float(prediction.left_map.to(torch.float32).mean()),
        "highest": rates,
        "head_rate_of_each_spell": [round(rate, 3) for rate in prediction.head_rate.tolist()],
        "by_hour": hours,
    }


def page(found: Mapping[str, Any]) -> str:
    """Return the report as Markdown, from ``report.json``'s content."""
    area, highest, held = found["area_ha"], found["highest"], found["gigabytes"]
    lines = [
        f"# {found['title']}",
        "",
        f"{found['fires']} fires of {_hours(found['followed_minutes'])}, warp_torchrl {found['version']}, "
        f"{found['seconds']['all']:.1f} s in all, {found['seconds']['fires']:.1f} s of it the fires.",
        f"Up to {found['at_once']} fires at a time; memory {held['most']:.2f} GB at most, of it the program "
        f"{held['program']:.2f} GB, the map's layers {held['map']:.2f} GB.",
        "",
        f"- area burned: {area['median']:,.0f} ha (5 % to 95 %: {area['low']:,.0f} to {area['high']:,.0f} ha)",
        f"- came to the map's edge: {found['left_map']:.0%} of the fires",
        f"- rate of spread as fires came, mean of each cell: {highest['rate']['median']:.3g} m/min in the middle, "
        f"{highest['rate']['p99']:.3g} m/min in the fastest hundredth",
        f"- fireline intensity: {highest['intensity']['median']:,.0f} and {highest['intensity']['p99']:,.0f} kW/m; "
        f"flame length: {highest['flame_length']['median']:.2g} and {highest['flame_length']['p99']:.2g} m",
        *(f"- warning: {each}" for each in found["warnings"]),
        "",
        *_table(found["by_hour"]),
        "",
        *(f"- {name}: {value}" for name, value in found["inputs"].items()),
        *section(found["files"]),
    ]
    return "\n".join(lines) + "\n"


def warnings(found: Mapping[str, Any], weather_minutes: float) -> list[str]:
    """Return warnings about the maps: fires that left the map, weather that ended before the fires."""
    said = []
    if found["left_map"] > 0.0:
        said.append(
            f"{found['left_map']:.0%} of the fires came to the map's edge, beyond which nothing burns: areas and "
            f"times behind it are too low or too late; a larger map or fewer hours"
        )
    longest = found["followed_minutes"]["high"]
    if longest > weather_minutes + 1e-3:
        said.append(
            f"the weather ends after {weather_minutes / 60.0:g} hours, and its last row holds on until "
            f"{longest / 60.0:g} hours"
        )
    return said


def _table(hours: list[dict[str, Any]]) -> list[str]:
    """Return the rows of a table of hours; of many, evenly chosen ones and the last."""
    step = -(-len(hours) // _ROWS)
    shown = hours[::step] if hours[::step][-1] is hours[-1] else [*hours[::step], hours[-1]]
    rows = ["| hour | area [ha] | 5 % | 95 % | head [km from the start] |", "|---|---|---|---|---|"]
    for each in shown:
        area, head = each["area_ha"], each["head_m"]
        rows.append(
            f"| {each['hour']:g} | {area['median']:,.4g} | {area['low']:,.4g} | {area['high']:,.4g} | "
            f"{head['median'] / 1000.0:.2f} |"
        )
    return rows


def _spread(values: Tensor) -> dict[str, float]:
    """Return median, 5 % and 95 % of the fires."""
    found = values.to(torch.float64).quantile(torch.tensor([0.5, 0.05, 0.95], dtype=torch.float64)).tolist()
    return dict(zip(("median", "low", "high"), found, strict=True))


def _highest(values: Tensor) -> dict[str, float]:
    """Return the median, the 99th percentile and the highest of the cells where a fire came; 0 without any."""
    known = values[~values.isnan()].to(torch.float64)
    if not len(known):
        return {"median": 0.0, "p99": 0.0, "highest": 0.0}
    order = known.sort().values
    places = [round(share * (len(order) - 1)) for share in (0.5, 0.99, 1.0)]
    return dict(zip(("median", "p99", "highest"), order[places].tolist(), strict=True))


def _hours(minutes: Mapping[str, float]) -> str:
    low, high = (minutes[name] / 60.0 for name in ("low", "high"))
    return f"{high:.3g} hours" if high - low < 1e-6 else f"{low:.3g} to {high:.3g} hours"
