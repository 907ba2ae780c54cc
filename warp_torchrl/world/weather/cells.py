"""Numbers in the cells of a table of weather: missing values, calm winds, points of the compass, traces of rain."""

import math
from collections.abc import Sequence

from warp_torchrl.system.delimited import to_number, to_points
from warp_torchrl.world.weather.columns import Column
from warp_torchrl.world.weather.layout import Sheet
from warp_torchrl.world.weather.quantities import ASKED, QUANTITIES
from warp_torchrl.world.weather.units import ascii_text

_MISSING = frozenset("m na n/a nan null none nil missing - -- --- n/d s/d * ** *** .".split())
_MISSING_NUMBERS = (-9999.0, -999.0, -99.0, 9999.0, 99999.0, -99999.0, 999.9, 9999.9, -999.9, -99.9, 1e20, -6999.0)
_CALM = frozenset("calm calma calme vrb variable var c".split())
_NO_DIRECTION = (990.0, 999.0)
_POINTS = ("n nne ne ene e ese se sse s ssw sw wsw w wnw nw nnw").split()
_COMPASS = {
    **{point: 22.5 * place for place, point in enumerate(_POINTS)},
    **{"north": 0.0, "northeast": 45.0, "east": 90.0, "southeast": 135.0, "south": 180.0, "southwest": 225.0},
    **{"west": 270.0, "northwest": 315.0, "norte": 0.0, "nordeste": 45.0, "este": 90.0, "sudeste": 135.0},
    **{"sur": 180.0, "sul": 180.0, "sudoeste": 225.0, "oeste": 270.0, "noroeste": 315.0},
}
"""Degrees from north; O alone is west in some languages and east in others, and is not read."""


def is_missing(cell: str) -> bool:
    """Return whether a cell stands for a value that is not known."""
    number = to_number(cell)
    return not cell or ascii_text(cell) in _MISSING or number in _MISSING_NUMBERS


def column_values(name: str, column: Column, sheet: Sheet) -> list[float] | None:
    """Return a column's values in our unit; None if all cells are empty and the quantity is optional.

    Of ``ASKED`` quantities a missing cell is NaN.

    Raises:
        ValueError: If a cell is missing, no number, or out of the quantity's range, with the row.
    """
    cells = _cells(column, sheet)
    if name not in ("wind_speed", "wind_u", "wind_v") and all(is_missing(cell) for cell in cells):
        return None
    may_lack = name in ASKED
    values = [
        math.nan if may_lack and is_missing(cell) else _value(name, column, cell, row)
        for row, cell in enumerate(cells, 1)
    ]
    if name == "humidity" and column.unit == "%" and 0.0 < max(values) <= 1.0:
        raise ValueError(
            f"{column.header} must be in per cent, or say units.humidity=fraction, got {max(values):g} at most"
        )
    return values


def bearings(column: Column, sheet: Sheet, speeds: Sequence[float]) -> list[float]:
    """Return the direction from which the wind blows in each row [degrees]; 0 without wind.

    Raises:
        ValueError: If a wind has no direction, or one that cannot be read, with the row.
    """
    found = []
    for row, (cell, speed) in enumerate(zip(_cells(column, sheet), speeds, strict=True), 1):
        point = ascii_text(cell).replace(" ", "").replace("-", "")
        number = to_number(cell)
        none = is_missing(cell) or point in _CALM or number in _NO_DIRECTION or _is_no_direction(number, sheet)
        if speed == 0.0 and (none or number is None):
            found.append(0.0)
        elif none:
            raise ValueError(
                f"{column.header} must tell where wind of {speed:g} m/s comes from, got {cell!r} in row {row}: "
                f"leave the row out, or give it a direction"
            )
        elif point in _COMPASS:
            found.append(_COMPASS[point])
        else:
            found.append(_value("wind_bearing", column, cell, row))
    return found


def _is_no_direction(number: float | None, sheet: Sheet) -> bool:
    return sheet.calm_at_zero and number == 0.0


def _cells(column: Column, sheet: Sheet) -> list[str]:
    cells = [row[column.place].strip() for row in sheet.rows]
    return to_points(column.header, cells, sheet.separator)


def _value(name: str, column: Column, cell: str, row: int) -> float:
    quantity = QUANTITIES[name]
    if name == "rain" and ascii_text(cell) in ("t", "tr", "trace"):  # too little to measure
        return 0.0
    number = to_number(cell)
    if is_missing(cell) and not (number is not None and quantity.lowest <= number <= quantity.highest):
        raise ValueError(
            f"{column.header} must be a number, got {cell!r} in row {row}, which is missing: leave the row out, or "
            f"fill it"
        )
    if number is None:
        raise ValueError(f"{column.header} must be a number, got {cell!r} in row {row}")
    value = column.factor * number + column.offset
    if not quantity.lowest - 1e-6 <= value <= quantity.highest + 1e-6:
        limits = f"[{quantity.lowest:g}, {quantity.highest:g}] {quantity.unit}".strip()
        raise ValueError(f"{column.header} must be in {limits}, got {value:g} in row {row}")
    return value
