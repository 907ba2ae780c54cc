"""A prediction in numbers."""

import pytest
import torch

from tests.prediction.test_predict import UNEVEN, run
from warp_torchrl.prediction.report import page, report_numbers


@pytest.fixture(scope="module")
def prediction():
    return run(270.0, 270.0, fire=UNEVEN, fires=7)


def test_the_highest_are_places_in_the_order_of_the_cells_where_a_fire_came(prediction):
    told = report_numbers(prediction)["highest"]
    for name in ("rate", "intensity", "flame_length"):
        plane = getattr(prediction, name)
        known = plane[~plane.isnan()].double()
        for part, share in {"median": 0.5, "p99": 0.99, "highest": 1.0}.items():
            place = torch.quantile(known, share, interpolation="nearest")
            assert told[name][part] == pytest.approx(float(place)), (name, part)


def test_fires_are_told_by_their_median_and_by_all_but_the_twentieth_at_each_end(prediction):
    told, area = report_numbers(prediction), prediction.final_area.double().sort().values.tolist()
    # Of 7 in order, places 3, 0.3 and 5.7
    low, high = area[0] + 0.3 * (area[1] - area[0]), area[5] + 0.7 * (area[6] - area[5])
    assert [told["area_ha"][each] for each in ("median", "low", "high")] == pytest.approx([area[3], low, high])
    assert [row["hour"] for row in told["by_hour"]] == [0.0, 1.0, 2.0]
    assert told["by_hour"][2]["area_ha"]["median"] == pytest.approx(float(prediction.area[:, 2].median()))
    assert told["by_hour"][1]["head_m"]["median"] == pytest.approx(float(prediction.progress[:, 1].median()))
    assert told["left_map"] == float(prediction.left_map.float().mean()) and told["fires"] == 7


def test_of_many_hours_the_page_shows_some_and_the_last(prediction):
    said = report_numbers(prediction)
    hours = [{**said["by_hour"][0], "hour": float(hour)} for hour in range(60)]
    more = {
        "title": "a",
        "version": "0",
        "seconds": {"all": 1.0, "fires": 0.5},
        "gigabytes": {"most": 0.5, "program": 0.4, "map": 0.01},
        "warnings": [],
        "inputs": {},
        "files": [],
    }
    lines = page({**said, **more, "by_hour": hours}).splitlines()
    shown = [int(line.split("|")[1]) for line in lines if line.startswith("| ") and "hour" not in line]
    assert shown == [*range(0, 60, 3), 59]  # every third: 25 rows at most, and the last
