"""Tables of fine dead fuel moisture: rows worked by hand from NWCG's tables A to D."""

import pytest
import torch

from warp_torchrl.world.weather.fosberg import correction, reference_moisture

GENTLE, STEEP, SHADED = range(3)
NORTH, EAST, SOUTH, WEST = range(4)


def test_reference_moisture_is_that_of_table_a():
    # 85 F and 22 %: row 70-89 F, column 20-24 %: 3. 45 F and 100 %: 13. 20 F and 47 %: 8. 112 F and 3 %: 1.
    fahrenheit, humidity = torch.tensor([85.0, 45.0, 20.0, 112.0]), torch.tensor([22.0, 100.0, 47.0, 3.0])
    assert reference_moisture((fahrenheit - 32.0) / 1.8, humidity).tolist() == [3.0, 13.0, 8.0, 1.0]


@pytest.mark.parametrize(
    "month, hour, ground, aspect, added",
    [
        (8, 14.5, STEEP, SOUTH, 1.0),  # table C, August, 1400-1559, exposed, south, 31+ %
        (8, 14.5, STEEP, NORTH, 3.0),
        (8, 14.5, SHADED, SOUTH, 4.0),
        (6, 8.0, STEEP, EAST, 2.0),  # table B, June: the morning sun is on the east
        (6, 8.0, STEEP, WEST, 5.0),
        (6, 18.0, STEEP, EAST, 5.0),
        (6, 19.9, STEEP, WEST, 2.0),
        (1, 12.0, STEEP, SOUTH, 1.0),  # table D, January
        (1, 12.0, GENTLE, NORTH, 3.0),
        (7, 22.0, STEEP, WEST, 4.0),  # at night that of shaded fuel, in every ground
        (7, 3.0, GENTLE, NORTH, 5.0),
    ],
)
def test_corrections_are_those_of_tables_b_to_d(month, hour, ground, aspect, added):
    assert float(correction(month, hour)[ground, aspect]) == added
