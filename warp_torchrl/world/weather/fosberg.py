"""Moisture of fine dead fuel by sun and slope: the tables of Fosberg and Deeming (1971, RM-207) for the field.

A reference moisture of temperature and humidity, and a correction by month, time of day, aspect, slope and shade
(Rothermel 1983, INT-143; today NWCG, PMS 437, "Dead fuel moisture content", tables A to D). Corrections are those of
ground within 1000 ft of the station's elevation, as BEHAVE's fine dead fuel moisture tool has them; another
transcription differs in five of them, each by 1.

The corrections end at 20 o'clock and begin at 8. In the night between, ours are those of shaded fuel: of the last
column until midnight, of the first one after.
"""

import torch
from torch import Tensor

ASPECTS = ("north", "east", "south", "west")
"""Columns of ``correction``: where downhill is."""
STEEP = 0.3
"""Rise over run from which ground is steep."""
SHADY = 50.0
"""Crowns or clouds [%] from which fuel is shaded."""
_HUMIDITY = 5.0  # width of the table's classes [%]
_WARM = (30.0, 50.0, 70.0, 90.0, 110.0)  # where its classes of temperature begin [F]
_REFERENCE = torch.tensor(
    [
        [1, 2, 2, 3, 4, 5, 5, 6, 7, 8, 8, 8, 9, 9, 10, 11, 12, 12, 13, 13, 14],
        [1, 2, 2, 3, 4, 5, 5, 6, 7, 7, 7, 8, 9, 9, 10, 10, 11, 12, 13, 13, 13],
        [1, 2, 2, 3, 4, 5, 5, 6, 6, 7, 7, 8, 8, 9, 9, 10, 11, 12, 12, 12, 13],
        [1, 1, 2, 2, 3, 4, 5, 5, 6, 7, 7, 8, 8, 8, 9, 10, 10, 11, 12, 12, 13],
        [1, 1, 2, 2, 3, 4, 4, 5, 6, 7, 7, 8, 8, 8, 9, 10, 10, 11, 12, 12, 13],
        [1, 1, 2, 2, 3, 4, 4, 5, 6, 7, 7, 8, 8, 8, 9, 10, 10, 11, 12, 12, 12],
    ],
    dtype=torch.float32,
)
_SUMMER, _BETWEEN, _WINTER = range(3)
_SEASONS = (*(_WINTER,), *(_BETWEEN,) * 3, *(_SUMMER,) * 3, *(_BETWEEN,) * 3, *(_WINTER,) * 2)  # of January, ...
# By season, two hours from 8 o'clock on: gentle, steep and shaded ground, each of the four aspects
_CORRECTION = torch.tensor(
    [
        [
            [[3, 2, 3, 3], [4, 2, 3, 5], [5, 4, 4, 5]],
            [[1, 1, 1, 1], [2, 0, 1, 3], [4, 4, 4, 4]],
            [[0, 0, 0, 0], [1, 0, 1, 1], [3, 3, 3, 3]],
            [[0, 0, 0, 0], [1, 1, 1, 0], [3, 4, 3, 3]],
            [[1, 1, 1, 1], [2, 3, 1, 0], [4, 4, 4, 4]],
            [[3, 4, 3, 3], [4, 5, 3, 2], [5, 5, 5, 4]],
        ],
        [
            [[4, 4, 4, 4], [4, 3, 4, 5], [5, 5, 5, 5]],
            [[2, 2, 2, 2], [3, 1, 2, 4], [5, 4, 4, 5]],
            [[1, 1, 1, 1], [3, 1, 1, 2], [4, 4, 4, 4]],
            [[1, 1, 1, 1], [3, 2, 1, 1], [4, 4, 4, 4]],
            [[2, 2, 2, 2], [3, 4, 2, 1], [5, 5, 4, 4]],
            [[4, 4, 4, 4], [4, 5, 4, 3], [5, 5, 5, 5]],  # the 5 is 4 in BEHAVE's tool, between 3 and 6
        ],
        [
            [[5, 5, 5, 5], [5, 5, 5, 5], [5, 5, 5, 5]],
            [[4, 4, 4, 4], [5, 3, 3, 5], [5, 5, 5, 5]],
            [[3, 3, 3, 3], [5, 2, 1, 4], [5, 5, 5, 5]],
            [[3, 3, 2, 3], [5, 4, 1, 2], [5, 5, 5, 5]],
            [[4, 4, 4, 4], [5, 5, 3, 3], [5, 5, 5, 5]],
            [[5, 5, 5, 5], [5, 5, 5, 5], [5, 5, 5, 5]],
        ],
    ],
    dtype=torch.float32,
)


def reference_moisture(temperature: Tensor, humidity: Tensor) -> Tensor:
    """Return the moisture of fine dead fuel before corrections [per cent], of the arguments' shape.

    Args:
        temperature: Of the air [C].
        humidity: Of the air [per cent].
    """
    fahrenheit = (1.8 * temperature + 32.0).contiguous()
    row = torch.bucketize(fahrenheit, torch.tensor(_WARM, device=temperature.device), right=True)
    column = (humidity / _HUMIDITY).floor().clamp(0.0, 20.0).long()
    return _REFERENCE.to(temperature.device)[row, column]


def correction(month: int, hour: float) -> Tensor:
    """Return what is added on gentle, steep and shaded ground of each aspect, float32 [3, 4] [per cent].

    Args:
        month: 1 to 12, of the northern hemisphere.
        hour: Local time, in [0, 24).
    """
    found = _CORRECTION[_SEASONS[month - 1]]
    if 8.0 <= hour < 20.0:
        return found[int((hour - 8.0) // 2.0)]
    night = found[5 if hour >= 20.0 else 0, 2]
    return night.expand(3, 4)
