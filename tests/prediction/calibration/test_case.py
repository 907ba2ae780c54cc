"""Fires that happened, read from files as predict reads them."""

import json

import numpy as np
import pytest
import torch

from warp_torchrl.prediction.calibration.case import read_fire_case
from warp_torchrl.prediction.calibration.fitting import check_fuel_codes
from warp_torchrl.world.law.rate import RateFire
from warp_torchrl.world.terrain.layers import CanopyUnits

rasterio = pytest.importorskip("rasterio", reason="rasters need the extra gis")
warp = pytest.importorskip("rasterio.warp")

UTM, SIDE = "EPSG:32610", 20
RING = [(500090 + 30 * c, 4499910 - 30 * r) for r, c in ((0, 0), (0, 8), (6, 8), (6, 0), (0, 0))]
"""Six rows of eight cells, from row 3 and column 3 on."""


def tif(path, values, dtype="int16", **options):
    values = np.asarray(values, dtype)
    place = rasterio.Affine(30.0, 0.0, 5e5, 0.0, -30.0, 4.5e6)
    profile = {"count": 1, "height": values.shape[0], "width": values.shape[1], "dtype": dtype, "transform": place}
    with rasterio.open(path, "w", driver="GTiff", **{"crs": UTM, **profile, **options}) as file:
        file.write(values[None])
    return path


def asc(path, values, nodata=True):
    header = f"ncols {SIDE}\nnrows {SIDE}\nxllcorner 500000\nyllcorner 4499400\ncellsize 30\n"
    lines = "\n".join(" ".join(f"{value:g}" for value in row) for row in values)
    path.write_text(header + "NODATA_value -9999\n" * nodata + lines + "\n")


@pytest.fixture
def fire(tmp_path):
    """A fire of two hours in grass, in UTM, without an outcome."""
    folder = tmp_path / "small"
    folder.mkdir()
    tif(folder / "fuel.tif", np.full((SIDE, SIDE), 102))
    (folder / "ignition.csv").write_text("row,column\n10,4\n")
    rows = "".join(f"2020-07-01 {hour}:00,8,270,30,25,0\n" for hour in (12, 13))
    (folder / "weather.csv").write_text("datetime,WS,WD,TMP,RH,APCP\n" + rows)
    return folder


def perimeters(folder, *properties, crs="EPSG:4326", ring=RING, name="perimeters.geojson", stated=True, more=()):
    shape = warp.transform_geom(UTM, crs, {"type": "Polygon", "coordinates": [ring]})
    features = [{"type": "Feature", "properties": each, "geometry": shape} for each in properties]
    member = {"crs": {"type": "name", "properties": {"name": crs}}} if stated else {}
    (folder / name).write_text(json.dumps({"type": "FeatureCollection", **member, "features": [*features, *more]}))


@pytest.mark.parametrize("crs", ["EPSG:4326", UTM, "EPSG:3857", "EPSG:4267"])
def test_perimeters_are_in_the_crs_that_their_file_states(fire, crs):
    empty = {"type": "Feature", "properties": {"hours": 1}, "geometry": None}
    perimeters(fire, {"hours": 1}, crs=crs, more=[empty])
    scar = read_fire_case(fire).scar
    assert int(scar.sum()) == 48 and scar[3:9, 3:11].all()


@pytest.mark.parametrize(
    "told, hours, minutes",
    [
        ({"hours": 1}, None, 60.0),
        ({"hours": "1.5"}, None, 90.0),
        ({"Minutes": "30"}, None, 30.0),
        ({"minutes": None, "HOURS": 1}, None, 60.0),
        ({"incident": "Camp", "gis_acres": 4.0}, None, 120.0),  # NIFC: the end of the weather
        ({"Event_ID": "CA1", "Ig_Date": "2020-07-01"}, 1.0, 60.0),  # MTBS, and hours=1
    ],
)
def test_the_time_of_a_perimeter_is_a_number_a_text_or_that_of_the_scar(fire, told, hours, minutes):
    perimeters(fire, told)
    assert read_fire_case(fire, hours).minutes.tolist() == [minutes]


def test_perimeters_without_a_time_beside_others_need_one(fire):
    perimeters(fire, {"hours": 0.5}, {"name": "final"})
    with pytest.raises(ValueError, match=r"^small: perimeters.geojson must have features with minutes or hours"):
        read_fire_case(fire)
    assert read_fire_case(fire, 1.5).minutes.tolist() == [30.0, 90.0]


def test_perimeters_of_other_times_do_not_pass_for_one(fire):
    perimeters(fire, {"poly_DateCurrent": 1719838800000}, {"poly_DateCurrent": 1719842400000})
    with pytest.raises(
        ValueError, match=r"hours= must say .*, its features have poly_DateCurrent 1719838800000, 17198424"
    ):
        read_fire_case(fire)
    assert read_fire_case(fire, 1.5).minutes.tolist() == [90.0]
    perimeters(fire, {"DATE_": "2024-07-01"}, {"DATE_": "2024-07-01"})
    assert len(read_fire_case(fire).minutes) == 1


@pytest.mark.parametrize("value", ["noon", -1, 0, True, [1], 1e400, "nan"])
def test_times_that_are_none_are_refused(fire, value):
    perimeters(fire, {"hours": value})
    with pytest.raises(ValueError, match=r"^small: perimeters.geojson must have features with minutes or hours over 0"):
        read_fire_case(fire)


def test_a_narrow_perimeter_beside_another_has_its_cells(fire):
    x, y = 500005.0, 4499520.0  # a strip of eight metres along a diagonal
    strip = [(x, y), (x + 400, y - 80), (x + 400, y - 88), (x, y - 8), (x, y)]
    perimeters(fire, {"hours": 1}, crs=UTM)
    alone = int(read_fire_case(fire).scar.sum())
    shape = {"type": "Polygon", "coordinates": [strip]}
    perimeters(fire, {"hours": 1}, crs=UTM, more=[{"type": "Feature", "properties": {"hours": 1}, "geometry": shape}])
    assert int(read_fire_case(fire).scar.sum()) > alone + 12


def test_a_shapefile_is_a_scar(fire):
    shapefile = pytest.importorskip("shapefile")
    with shapefile.Writer(str(fire / "scar.shp"), shapeType=shapefile.POLYGON) as writer:
        writer.field("FIRE", "C")
        writer.poly([RING])
        writer.record("Camp")
    (fire / "scar.prj").write_text(rasterio.crs.CRS.from_string(UTM).to_wkt())
    case = read_fire_case(fire)
    assert int(case.scar.sum()) == 48 and case.last == 120.0
    assert case.files == [
        "fuel: fuel.tif",
        "elevation: none, the ground is level",
        "ignition: ignition.csv",
        "outcome: scar.shp",
    ]


def test_what_nobody_reads_is_named(fire):
    perimeters(fire, {"hours": 1})
    tif(fire / "canopy.tif", np.full((SIDE, SIDE), 50))
    assert read_fire_case(fire).files[-1] == "files of small that are not read: canopy.tif"


def test_a_canopy_is_read_by_its_names_and_units(fire):
    perimeters(fire, {"hours": 1})
    plane = np.full((SIDE, SIDE), 50)
    for name in ("canopy_cover", "canopy_height", "canopy_base_height", "canopy_bulk_density"):
        tif(fire / f"{name}.tif", plane)
    case = read_fire_case(fire, canopy=CanopyUnits(height=0.1, density=0.01))
    expected = {"canopy_cover": 50.0, "canopy_height": 5.0, "canopy_base_height": 5.0, "canopy_bulk_density": 0.5}
    assert {name: float(case.landscape.layer(name).unique()) for name in expected} == expected
    assert "canopy_bulk_density: canopy_bulk_density.tif [0.01 kg/m3]" in case.files
    with pytest.raises(ValueError, match=r"^small: height_unit must be given with canopy_height, 0.1 for LANDFIRE"):
        read_fire_case(fire)
    (fire / "canopy_height.tif").unlink()
    with pytest.raises(ValueError, match=r"^small: canopy_base_height must be given with canopy_height, by which"):
        read_fire_case(fire, canopy=CanopyUnits(0.1, 0.01))


@pytest.mark.parametrize("kind", ["asc", "tif"])
def test_times_of_arrival_without_declared_nodata_are_those_of_cells_that_burned(fire, kind):
    times = np.full((SIDE, SIDE), -9999.0)
    times[5, 5:8] = 0.0, 20.0, 70.0
    if kind == "asc":
        asc(fire / "arrival.asc", times, nodata=False)
    else:
        tif(fire / "arrival.tif", times, "float32")
    case = read_fire_case(fire)
    assert case.burned.sum((1, 2)).tolist() == [2, 3] and int((~case.arrival.isnan()).sum()) == 3


def test_times_of_arrival_are_in_the_unit_that_the_band_states(fire):
    path = tif(fire / "arrival.tif", np.where(np.eye(SIDE) > 0, 1.5, -1.0), "float32")
    with rasterio.open(path, "r+") as file:
        file.units = ("hours",)
    assert read_fire_case(fire).arrival[3, 3] == 90.0


@pytest.mark.parametrize("name", ["ignition.tif", "ignition.geojson"])
def test_an_ignition_may_be_what_predict_reads(fire, name):
    (fire / "ignition.csv").unlink()
    perimeters(fire, {"hours": 1})
    if name.endswith(".tif"):
        values = np.full((SIDE, SIDE), -9999)
        values[3:9, 3:11] = 1
        tif(fire / name, values)
    else:
        perimeters(fire, {}, name=name)
    assert torch.equal(read_fire_case(fire).lit, read_fire_case(fire).scar)


@pytest.mark.parametrize(
    "write, words",
    [
        (lambda f: perimeters(f, {"hours": 3}), "the outcome must be known in hours of the weather, 2, got 3"),
        (lambda f: perimeters(f, {"hours": 1}, ring=[(x + 9000, y) for x, y in RING]), "must hold shapes on the map"),
        (lambda f: perimeters(f, {"hours": 1}, crs=UTM, stated=False), "must be in longitude and latitude where"),
        (lambda f: tif(f / "elevation.tif", np.full((SIDE, SIDE), -9999), "float32"), "elevation must be in"),
        (lambda f: tif(f / "arrival.tif", np.full((SIDE, SIDE), -1)), "arrival must hold a time of 0 or more"),
        (lambda f: tif(f / "arrival.tif", np.full((SIDE, SIDE), 1e30), "float32"), "arrival must be minutes, at most"),
        (lambda f: tif(f / "scar.tif", np.full((SIDE, SIDE), -1)), "scar must mark a cell of the map"),
        (lambda f: (f / "fuel.asc").touch(), "fuel must be one file in .*, got fuel.tif, fuel.asc"),
        (lambda f: tif(f / "fuel.tif", np.full((SIDE, SIDE), 102), crs="EPSG:3857"), "fuel must have square cells"),
    ],
)  # fmt: skip
def test_what_does_not_fit_is_refused_in_one_line(fire, write, words):
    perimeters(fire, {"hours": 1})
    write(fire)
    if len(list(fire.glob("arrival.*")) + list(fire.glob("scar.*"))) > 0:
        (fire / "perimeters.geojson").unlink()
    with pytest.raises(ValueError, match=f"^small: .*{words}") as error:
        read_fire_case(fire)
    assert "\n" not in str(error.value)


def test_hours_beyond_the_weather_are_refused(fire):
    perimeters(fire, {})
    assert read_fire_case(fire, 2.0).last == 120.0
    with pytest.raises(ValueError, match="known in hours of the weather, 2, got 40"):
        read_fire_case(fire, 40.0)


def test_fuel_that_the_law_lacks_is_named(fire):
    codes = np.full((SIDE, SIDE), 102)
    codes[0, :3], codes[1, 0] = 312, -9999
    tif(fire / "fuel.tif", codes)
    perimeters(fire, {"hours": 1})
    case = read_fire_case(fire)
    with pytest.raises(ValueError, match=r"^small: fuel must hold codes of fbfm40, 99 where .*, got 312 \(3 cells\)$"):
        check_fuel_codes(case, RateFire())
    assert RateFire().told_fuel(case.landscape) == "102 (396); no fuel: 99 (1), 312 (3)"
