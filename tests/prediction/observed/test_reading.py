"""Files of what was seen: perimeters and hot spots with times of many forms, and refusals in one line."""

import json

import pytest

from tests.world.rasters import rasterio  # noqa: F401
from warp_torchrl.prediction.observed.reading import read_observations
from warp_torchrl.world.terrain.geotiff import local_grid
from warp_torchrl.world.terrain.grid import Grid

SIZE = (20, 30)


def grid():
    from rasterio.crs import CRS
    from rasterio.transform import from_origin

    plain = local_grid(SIZE, 100.0)
    return plain._replace(transform=from_origin(500_000.0, 4_002_000.0, 100.0, 100.0), crs=CRS.from_epsg(32610))


def moment(text):
    if not text.startswith("2024-07-01"):
        raise ValueError(f"the time of what is observed must be a date and time, got {text!r}")
    hours, minutes = text[11:16].split(":")
    return 60.0 * int(hours) + int(minutes) - 720.0


def box(west, north, side, **properties):
    ring = [[west, north], [west + side, north], [west + side, north - side], [west, north - side], [west, north]]
    return {"type": "Feature", "properties": properties, "geometry": {"type": "Polygon", "coordinates": [ring]}}


def read(path, end=600.0):
    return read_observations(path, grid(), (0, 0), SIZE, moment, end)


def perimeters(tmp_path, *features):
    path = tmp_path / "seen.geojson"
    crs = {"type": "name", "properties": {"name": "urn:ogc:def:crs:EPSG::32610"}}
    path.write_text(json.dumps({"type": "FeatureCollection", "crs": crs, "features": list(features)}))
    return path


def test_the_grid_is_one_of_the_package():
    assert isinstance(grid(), Grid)


def test_perimeters_are_in_the_order_of_time_whatever_form_it_has(tmp_path):
    places = [
        (500_000, 4_002_000, 500),
        (500_500, 4_002_000, 300),
        (500_000, 4_001_000, 100),
        (500_000, 4_002_000, 200),
    ]
    times = [{"hours": 2}, {"minutes": "120"}, {"poly_DateCurrent": 1719838800000}, {"datetime": "2024-07-01T12:30"}]
    found = read(perimeters(tmp_path, *(box(*each, **time) for each, time in zip(places, times, strict=True))))
    assert [each.minutes for each in found] == [30.0, 60.0, 120.0]
    assert [int(each.cells.sum()) for each in found] == [4, 1, 34] and found[0].kind == "perimeter"


def test_hot_spots_of_ten_minutes_are_one_pass(tmp_path):
    path = tmp_path / "viirs.csv"
    rows = ["36.155,-122.995,2024-07-01,1312", "36.156,-122.99,2024-07-01,1318", "36.156,-122.98,2024-07-01,1448"]
    path.write_text("latitude,longitude,acq_date,acq_time\n" + "\n".join(rows) + "\n50,10,2024-07-01,1449\n")
    found = read(path)
    assert [(each.minutes, int(each.cells.sum()), each.kind) for each in found] == [
        (72.0, 2, "hot_spots"),
        (168.0, 1, "hot_spots"),
    ]


def test_what_is_not_after_the_start_or_too_late_is_left_out(tmp_path, caplog):
    features = [box(500_000, 4_002_000, 500, minutes=each) for each in (-5, 0, 30, 900)]
    assert [each.minutes for each in read(perimeters(tmp_path, *features))] == [30.0]


@pytest.mark.parametrize(
    ("text", "said"),
    [
        ("latitude,acq_date\n1,2\n", "must have the columns latitude and longitude"),
        ("latitude,longitude\n36.155,-122.995\n", "must have the columns acq_date and acq_time"),
        ("latitude,longitude,minutes\nx,-122.995,3\n", "must have a number for latitude"),
        ("latitude,longitude,minutes\n36.155,-222.995,3\n", "must have degrees for places, row 1"),
        ("latitude,longitude,minutes\n36.155,-122.995\n", "must have 3 cells in each row"),
        ("latitude,longitude,minutes\n50,10,3\n", "must have hot spots on the map"),
        ("latitude,longitude,minutes\n36.155,-122.995,-3\n", "must be seen after the start"),
        ("latitude,longitude,acq_date,acq_time\n36.155,-122.995,2024-07-01,99:99\n", "must have acq_time"),
        ("latitude,longitude,datetime\n36.155,-122.995,never\n", "the time of what is observed must be"),
        ("", "must have a header and a hot spot"),
    ],
)
def test_refusals_of_hot_spots_are_one_line(tmp_path, text, said):
    path = tmp_path / "viirs.csv"
    path.write_text(text)
    with pytest.raises(ValueError, match=said) as caught:
        read(path)
    assert "\n" not in str(caught.value) and str(path) in str(caught.value)


def test_refusals_of_perimeters_are_one_line(tmp_path):
    two = {"datetime": "2024-07-01T12:30", "date": "2024-07-01T12:40"}
    for properties, said in (({}, "must have minutes or hours"), (two, "must have one time for each polygon"),
                             ({"minutes": "soon"}, "must have a number for minutes")):  # fmt: skip
        with pytest.raises(ValueError, match=said):
            read(perimeters(tmp_path, box(500_000, 4_002_000, 500, **properties)))
    with pytest.raises(ValueError, match="observed must name a file that exists"):
        read(tmp_path / "none.geojson")
    point = {"type": "Feature", "properties": {}, "geometry": {"type": "Point", "coordinates": [500_100, 4_001_900]}}
    with pytest.raises(ValueError, match="must hold polygons"):
        read(perimeters(tmp_path, point))
