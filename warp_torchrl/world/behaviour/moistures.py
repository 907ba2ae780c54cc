"""Moistures of fuel by name, and their usual values."""

from collections.abc import Mapping

import torch
from torch import Tensor

MOISTURES: Mapping[str, float] = {
    "dead_1h": 6.0,
    "dead_10h": 7.0,
    "dead_100h": 8.0,
    "live_herbaceous": 60.0,
    "live_woody": 90.0,
    "ffmc": 90.0,
    "bui": 60.0,
}
"""Moisture where nothing else is said: per cent of dry weight, "low" dead and two-thirds cured fuels (Scott and Burgan
2005, tables 3 and 4); of the Canadian model its two codes."""
_DEAD_1H, _FFMC = (list(MOISTURES).index(name) for name in ("dead_1h", "ffmc"))


def moisture_row(given: Mapping[str, float]) -> Tensor:
    """Return moistures by name in the order of ``MOISTURES``, float32 [7].

    Raises:
        ValueError: If a name is not known, or a value not in [0, 400].
    """
    for name, value in given.items():
        if name not in MOISTURES:
            raise ValueError(f"moisture must name some of {', '.join(MOISTURES)}, got {name}")
        if not 0.0 <= value <= 400.0:
            raise ValueError(f"moisture must be in [0, 400], got {name}: {value}")
    return torch.tensor([float(given.get(name, usual)) for name, usual in MOISTURES.items()])


def in_force(told: Tensor | None, row: Tensor) -> Tensor:
    """Return what weather tells of moistures, float32 [..., 7], and those of a row where it tells nothing (NaN)."""
    return row if told is None else torch.where(told.isnan(), row, told)


def fine_moisture(moisture: Tensor, by_code: bool) -> Tensor:
    """Return the moisture of fine dead fuel [% of dry weight], float32 [...].

    Args:
        moisture: In the order of ``MOISTURES``, float32 [..., 7].
        by_code: Whether it is that of the fine fuel moisture code F, 147.2 (101 - F) / (59.5 + F) (Van Wagner 1987), as
            in the Canadian system, or that of dead fuel of one hour.
    """
    if not by_code:
        return moisture[..., _DEAD_1H]
    code = moisture[..., _FFMC]
    return 147.2 * (101.0 - code) / (59.5 + code)
