"""Maps and shapes as other tools write them, a row a source: read in the units that they state, or refused."""

import json
import math

import numpy as np
import pytest
import torch

from tests.world.rasters import keys, rasterio, refuse, write
from warp_torchrl.world.air.gridded import Gridded
from warp_torchrl.world.ignition.file import read_ignition
from warp_torchrl.world.law.rate import RateFire
from warp_torchrl.world.state.state import Cover
from warp_torchrl.world.terrain.grid import Grid
from warp_torchrl.world.terrain.layer import read_grid
from warp_torchrl.world.terrain.raster import Raster
from warp_torchrl.world.terrain.resampling import resample_layer

UTM = rasterio.crs.CRS.from_epsg(32610)
SIDE = 20
PLACE = rasterio.Affine(30.0, 0.0, 5e5, 0.0, -30.0, 4.5e6)
GRID = Grid((SIDE, SIDE), UTM, PLACE)
FOOT, SURVEY_FOOT = 0.3048, 1200.0 / 3937.0


def flat(value, dtype="int16"):
    return np.full((SIDE, SIDE), value, dtype)


def rising(dtype="float32", step=3.0):
    """Heights that rise by a step a row."""
    return np.add.outer(step * np.arange(SIDE), np.zeros(SIDE)).astype(dtype) + np.asarray(100, dtype)


def tif(path, *bands, names=(), units=(), crs=UTM, transform=PLACE, nodata=None, **options):
    """Write bands of one type with their descriptions and units."""
    first = np.asarray(bands[0])
    profile = {"driver": "GTiff", "count": len(bands), "height": first.shape[0], "width": first.shape[1]}
    profile |= {"dtype": first.dtype.name, "crs": crs, "transform": transform, "nodata": nodata}
    with rasterio.open(path, "w", **profile, **options) as file:
        file.write(np.stack(bands))
        for number, name in enumerate(names, start=1):
            file.set_band_description(number, name)
        if units:
            file.units = units
    return path


def asc(path, values, header="xllcorner 500000\nyllcorner 4499400\ncellsize 30\nNODATA_value -9999\n", **files):
    """Write an ESRI ASCII grid, and files beside it by their suffixes."""
    lines = "\n".join(" ".join(f"{value:g}" for value in row) for row in np.asarray(values))
    path.write_text(f"ncols {len(values[0])}\nnrows {len(values)}\n{header}{lines}\n")
    for suffix, text in files.items():
        path.with_suffix(f".{suffix}").write_text(text)
    return path


def at(epsg, longitude, latitude, cell):
    """Return the transform of cells about a place, in the units of a CRS."""
    from rasterio.warp import transform

    (x,), (y,) = transform("EPSG:4326", epsg, [longitude], [latitude])
    return rasterio.Affine(cell, 0.0, x - 10 * cell, 0.0, -cell, y + 10 * cell)


def ground(folder, **fields):
    return Raster(**{"path": folder, "size": SIDE, "row": 0, "column": 0, "fuel": "fuel.*", "elevation": None} | fields)


# --- Rasters of fuel, canopy and elevation

LANDFIRE = (
    "US_ELEV2020",
    "US_SLPD2020",
    "US_ASP2020",
    "LC22_F40_230",
    "LC22_CC_230",
    "LC22_CH_230",
    "LC22_CBH_230",
    "LC22_CBD_230",
)
UNDECLARED = "xllcorner 0\nyllcorner 0\ncellsize 30\n"
OLD_PRJ = "Projection UTM\nZone 10\nDatum NAD83\nUnits METERS\n"
FLAMMAP = (
    "Elevation",
    "Slope",
    "Aspect",
    "Fuel Model",
    "Canopy Cover",
    "Stand Height",
    "Canopy Base Height",
    "Canopy Bulk Density",
)


@pytest.mark.parametrize("names", [LANDFIRE, FLAMMAP], ids=["LANDFIRE", "FlamMap"])
def test_bands_of_a_landscape_file_are_found_by_their_descriptions(tmp_path, names):
    bands = [rising("int16"), flat(5), flat(180), flat(102), flat(60), flat(150), flat(10), flat(20)]
    path = tif(tmp_path / "landscape.tif", *bands, names=names)
    same = {"elevation": path.name, "canopy": path.name, "canopy_height": path.name, "height_unit": 0.1}
    crowns = {"canopy_base_height": path.name, "canopy_bulk_density": path.name, "density_unit": 0.01}
    source = ground(path, table="fbfm40", **same, **crowns)
    land = source(keys(1))
    layers = {name.removeprefix("canopy_"): layer.unique().tolist() for name, layer in land.layers.held.items()}
    assert layers.pop("bulk_density") == pytest.approx([0.2])
    assert layers == {"fuel": [102], "cover": [60], "height": [15], "base_height": [1]}
    assert land.elevation[0, :, 0].tolist() == rising()[:, 0].tolist()
    assert source.files[0] == f"fuel: landscape.tif, band {names[3]} [codes of fbfm40]"
    assert source.files[-1] == f"bands of landscape.tif that are not read: {names[1]}, {names[2]}"


def test_a_band_is_chosen_where_no_description_tells_which(tmp_path):
    tif(tmp_path / "fuel.tif", flat(1), flat(102))
    refuse(r"^fuel must have one band .* 1 \(int16\), 2 \(int16\); give bands=\{fuel: NUMBER\}$", ground, tmp_path)
    assert (ground(tmp_path, table="fbfm40", bands={"fuel": 2})(keys(1)).layer("fuel") == 102).all()
    refuse("; 3 names 0 of them; give bands", ground, tmp_path, bands={"fuel": 3})
    refuse("^bands must choose bands of fuel, got age", ground, tmp_path, bands={"age": 1})
    tif(tmp_path / "fuel.tif", flat(1), flat(102), names=("LC22_F13_230", "LC22_F40_230"))
    refuse("1 .LC22_F13_230., 2 .LC22_F40_230.; give", ground, tmp_path)
    assert (ground(tmp_path, bands={"fuel": "lc22_f13_230"})(keys(1)).layer("fuel") == 1).all()
    lit = tif(tmp_path / "lit.tif", flat(1), flat(0))
    refuse("^ignition.path must have one band .*; write the one that is meant into", read_ignition, lit, GRID)


def test_an_alpha_band_is_no_layer(tmp_path):
    path = tif(tmp_path / "fuel.tif", flat(102, "uint8"), holed(255, 0, "uint8"))
    with rasterio.open(path, "r+") as file:
        file.colorinterp = [rasterio.enums.ColorInterp.gray, rasterio.enums.ColorInterp.alpha]
    assert ground(tmp_path, table="fbfm40", nodata="unburnable")(keys(1)).layer("fuel")[0, 0, :2].tolist() == [99, 102]


def test_heights_of_minus_9999_are_nodata_in_an_ascii_grid_that_does_not_say(tmp_path):
    asc(tmp_path / "fuel.asc", flat(1), UNDECLARED)
    asc(tmp_path / "dem.asc", holed(500, -9999), UNDECLARED)
    assert (ground(tmp_path, elevation="dem.asc", nodata="unburnable")(keys(1)).elevation == 500).all()


@pytest.mark.parametrize(
    "units, epsg, given, metres",
    [
        (("m",), 32610, None, 1.0),
        (("US survey foot",), 32610, None, SURVEY_FOOT),
        (("ft",), 32610, None, FOOT),
        ((), "EPSG:2264+6360", None, SURVEY_FOOT),  # the vertical CRS is in feet
        ((), 2264, 1.0, 1.0),
        ((), 32610, FOOT, FOOT),
    ],
    ids=["3DEP", "band in US feet", "band in feet", "vertical CRS", "state plane, told", "told"],
)
def test_elevation_is_in_the_unit_that_the_file_states_or_the_user(tmp_path, units, epsg, given, metres):
    crs = epsg if isinstance(epsg, str) else f"EPSG:{epsg}"
    place = at(crs, -80.0, 35.0, 100.0) if "2264" in crs else PLACE
    tif(tmp_path / "fuel.tif", flat(1), crs=crs.partition("+")[0], transform=place)
    tif(tmp_path / "dem.tif", rising(), units=units, crs=crs, transform=place)
    source = ground(tmp_path, elevation="dem.tif", elevation_unit=given)
    found = source(keys(1)).elevation[0, :, 0]
    assert found.tolist() == pytest.approx((rising()[:, 0] * metres).tolist(), rel=1e-6)
    assert source.files[1] == f"elevation: dem.tif [{'m' if metres == 1.0 else f'{metres:g} m'}]"


@pytest.mark.parametrize(
    "units, crs, given, step, words",
    [
        (
            (),
            "EPSG:2264",
            None,
            3.0,
            "^elevation must state its unit where the map is in US survey foot, .*: give elevation_unit",
        ),
        (("fathom",), UTM, None, 3.0, "^elevation must be in m, .* states 'fathom'"),
        (("ft",), UTM, 1.0, 3.0, "^elevation_unit must be that of .* states 'ft', 0.3048, got 1"),
        (
            (),
            UTM,
            None,
            40.0,
            "^elevation must be in metres .* slopes are above 53 degrees: give elevation_unit",
        ),
    ],
)
def test_elevation_whose_unit_is_in_doubt_is_asked_for(tmp_path, units, crs, given, step, words):
    place = PLACE if crs is UTM else at(crs, -80.0, 35.0, 100.0)
    tif(tmp_path / "fuel.tif", flat(1), crs=crs, transform=place)
    tif(tmp_path / "dem.tif", rising(step=step), units=units, crs=crs, transform=place)
    refuse(words, ground, tmp_path, elevation="dem.tif", elevation_unit=given)


def test_the_canopy_is_in_the_unit_that_the_file_states_and_shares_are_refused(tmp_path):
    tif(tmp_path / "fuel.tif", flat(1))
    tif(tmp_path / "ch.tif", flat(15), units=("m",))
    tif(tmp_path / "cbd.tif", flat(0.5, "float32"), units=("kg m-3",))
    tif(tmp_path / "cc.tif", flat(0.5, "float32"))
    assert (ground(tmp_path, canopy_height="ch.tif")(keys(1)).layer("canopy_height") == 15).all()
    refuse("^height_unit must be that of .* states 'm'", ground, tmp_path, canopy_height="ch.tif", height_unit=0.1)
    refuse("^canopy must be in per cent, 0 to 100", ground, tmp_path, canopy="cc.tif")
    crowns = {name: "ch.tif" for name in ("canopy", "canopy_height", "canopy_base_height")}
    land = ground(tmp_path, **crowns, canopy_bulk_density="cbd.tif")(keys(1))
    assert (land.layer("canopy_bulk_density") == 0.5).all()


@pytest.mark.parametrize(
    "name, write_it, expected",
    [
        ("FARSITE, no nodata line", lambda p: asc(p, flat(102), UNDECLARED), 102),
        ("Prometheus, an old .prj", lambda p: asc(p, flat(102), prj=OLD_PRJ), 102),
        ("ESRI, a .prj of WKT", lambda p: asc(p, flat(102), prj=UTM.to_wkt()), 102),
        ("a hole of -9999 undeclared", lambda p: asc(p, holed(102, -9999), UNDECLARED), 102),
    ],
)  # fmt: skip
def test_ascii_grids_of_fire_models_are_read(tmp_path, name, write_it, expected):
    write_it(tmp_path / "fuel.asc")
    fuel = ground(tmp_path, table="fbfm40", nodata="unburnable")(keys(1)).layer("fuel")[0]
    assert fuel[5, 5] == expected and fuel[0, 0] == (99 if "hole" in name else expected)


@pytest.mark.parametrize("text", ["http://127.0.0.1:9/crs", "PROJCS[", "+init=/etc/os-release", "\x00", ""])
def test_a_prj_that_states_no_crs_is_told_of(tmp_path, text, capfd):
    asc(tmp_path / "fuel.asc", flat(1), prj=text)
    refuse("^fuel must have a .prj that states a CRS in WKT", ground, tmp_path)
    assert capfd.readouterr() == ("", "")


@pytest.mark.parametrize(
    "unit, factor", [("m/s", 1.0), ("mph", 0.44704), ("km/h", 1 / 3.6), ("", 1.0), ("furlong", None)]
)
def test_a_wind_is_in_the_unit_that_its_band_states(tmp_path, unit, factor):
    for name, value in (("u", 9.0), ("v", 0.0)):
        tif(tmp_path / f"a_{name}.tif", flat(value, "float32"), units=(unit,))
    if factor is None:
        refuse("^u must be in m/s, .* states 'furlong'", Gridded, path=tmp_path)
        return
    found = Gridded(path=tmp_path)(keys(1), (SIDE, SIDE))[0]
    assert found[0].unique().tolist() == pytest.approx([9.0 * factor]) and (found[1] == 0.0).all()


def holed(value, hole, dtype="int16"):
    """Codes with one that is not known in the corner."""
    codes = flat(value, dtype)
    codes[0, 0] = hole
    return codes


@pytest.mark.parametrize("hole, dtype", [(-9999, "int16"), (-32768, "int16"), (-3.4028235e38, "float32")])
def test_numbers_below_zero_are_no_fuel_whatever_the_file_declares(tmp_path, hole, dtype):
    tif(tmp_path / "fuel.tif", holed(1, hole, dtype))
    assert ground(tmp_path, nodata="unburnable")(keys(1)).layer("fuel")[0, 0, :2].tolist() == [99, 1]


def test_a_largest_number_that_no_table_has_is_refused_with_the_way_out(tmp_path):
    tif(tmp_path / "fuel.tif", holed(1, 255, "uint8"))
    refuse("it lacks 1: 255; if 255 is nodata, gdal_edit -a_nodata 255", ground, tmp_path)


@pytest.mark.parametrize(
    "table, codes, covers",
    [
        ("worldcover", (10, 30, 80), (Cover.FOREST, Cover.GRASSLAND, Cover.LAKE)),
        ("nlcd", (42, 71, 11), (Cover.FOREST, Cover.GRASSLAND, Cover.LAKE)),
        ("corine", (312, 321, 512), (Cover.FOREST, Cover.GRASSLAND, Cover.LAKE)),
    ],
)
def test_classes_of_land_cover_burn_as_their_cover(tmp_path, table, codes, covers):
    values = flat(codes[0])
    values[0, :2] = codes[1:]
    tif(tmp_path / "fuel.tif", values)
    source = ground(tmp_path, table=table)
    land = source(keys(1))
    assert land.layer("fuel") is None and land.cover[0, 0, :3].tolist() == [covers[1], covers[2], covers[0]]
    assert RateFire().on(source).bed.fuel(land)[0, 0, :3].tolist() == [102, 98, 165]


# --- Places: metres of the map and of the ground


@pytest.mark.parametrize(
    "crs, longitude, latitude, words",
    [
        ("EPSG:32610", -121, 50, None),
        ("EPSG:5070", -96, 49, None),  # Albers of the United States at its north border
        ("EPSG:3978", -110, 50, None),  # Lambert of Canada
        ("EPSG:3035", -8, 38, None),  # of Europe
        ("EPSG:2154", 2, 45, None),
        ("EPSG:3857", -121, 50, r"has cells of 19\.29 m there, and 30 m on the map; give resolution=30 resample=mode"),
        ("EPSG:3395", -121, 50, r"has cells of 19\.\d\d m there, and 30 m on the map"),
        ("EPSG:3978", -110, 61, r"has cells of 30\.\d+ m there"),  # twelve degrees from its parallel
        ("EPSG:5070", -150, 65, "has cells whose sides differ by 16.1 % there"),  # Alaska
        ("EPSG:6933", -121, 50, "has cells whose sides differ by 81"),
    ],
)
def test_metres_of_the_map_are_those_of_the_ground_or_refused(tmp_path, crs, longitude, latitude, words):
    path = tif(tmp_path / "fuel.tif", flat(1), crs=crs, transform=at(crs, longitude, latitude, 30.0))
    if words is None:
        assert read_grid("fuel", path).cell_size == 30.0
        return
    refuse(f"^fuel must have square cells in metres of the ground, .* {words}", ground, tmp_path)
    source = ground(tmp_path, resolution=30.0, resample="mode", nodata="unburnable", size=8)
    assert source.grid.crs.to_epsg() // 100 == 326 and source.cell_size == 30.0
    # as many cells hold fuel as the ground has square metres
    from rasterio.warp import transform_geom

    west, south, east, north = read_grid("fuel", path, metric=False).bounds
    ring = [[(west, south), (east, south), (east, north), (west, north), (west, south)]]
    moved = transform_geom(crs, "EPSG:6933", {"type": "Polygon", "coordinates": ring})  # equal areas all over the world
    x, y = np.array(moved["coordinates"][0]).T
    area = abs((x[:-1] * y[1:] - x[1:] * y[:-1]).sum()) / 2
    _, known = resample_layer("fuel", path, source.grid, "nearest")
    assert known.sum() * 900.0 == pytest.approx(area, rel=0.05)


def test_a_map_over_which_the_metre_changes_is_refused(tmp_path):
    place = at("EPSG:3978", -110.0, 49.0, 20_000.0)
    tif(tmp_path / "fuel.tif", flat(1), crs="EPSG:3978", transform=place)
    refuse("has cells whose sides change by", ground, tmp_path)


def test_elevation_in_degrees_comes_to_the_grid_of_the_fuel(tmp_path):
    tif(tmp_path / "fuel.tif", flat(1), crs="EPSG:32610")
    degrees = rasterio.Affine(1 / 3600, 0.0, -123.01, 0.0, -1 / 3600, 40.66)
    tif(tmp_path / "dem.tif", np.full((80, 80), 500, "float32"), crs="EPSG:4326", transform=degrees)  # Copernicus
    refuse("^elevation must have square cells in metres", ground, tmp_path, elevation="dem.tif")
    assert (ground(tmp_path, elevation="dem.tif", resample="mode")(keys(1)).elevation == 500).all()


# --- What GDAL must not do


def test_files_beside_a_raster_are_not_opened(tmp_path):
    secret = tif(tmp_path / "secret.tif", flat(0, "uint8"))
    path = tif(tmp_path / "fuel.tif", flat(1))
    vrt = (
        '<VRTDataset rasterXSize="20" rasterYSize="20"><Metadata domain="GDAL"><MDI key="INTERNAL_MASK_FLAGS_1">2</MDI>'
    )
    vrt += '</Metadata><VRTRasterBand dataType="Byte" band="1"><SimpleSource><SourceFilename relativeToVRT="1">'
    vrt += f"{secret.name}</SourceFilename><SourceBand>1</SourceBand></SimpleSource></VRTRasterBand></VRTDataset>"
    (tmp_path / "fuel.tif.msk").write_text(vrt)
    assert (ground(path)(keys(1)).layer("fuel") == 1).all()  # by the mask no cell would be known
    (tmp_path / "odd.tif").write_text(vrt)
    refuse("^fuel must be a whole GTiff raster", ground, tmp_path / "odd.tif")


def test_a_place_beside_a_raster_is_asked_into_it(tmp_path):
    path = write(tmp_path / "fuel.tif", flat(1), "int16", cell=None, crs=None)
    (tmp_path / "fuel.tfw").write_text("30\n0\n0\n-30\n500015\n4499985\n")
    refuse("^fuel must hold its place, which stands beside it in fuel.tfw", ground, path)


_OF_A_FILE = 'EXTENSION["PROJ4","+proj=longlat +nadgrids=/etc/os-release"]'
GRIDS = f"{rasterio.crs.CRS.from_epsg(4326).to_wkt()[:-1]},{_OF_A_FILE}]"


@pytest.mark.parametrize(
    "name",
    [
        "http://127.0.0.1:9/crs",
        "/vsicurl/http://127.0.0.1:9/crs",
        "/etc/os-release",
        "+init=/etc/os-release",
        "+proj=longlat +nadgrids=/etc/os-release",
        "+proj=utm +zone=10",
        "ESRI::/etc/os-release",
        "EPSG:",
        "urn:ogc:def:crs:OGC:1.3:CRS99",
        "PROJCS[" * 3000,
        "\x00",
        'GEOGCS["x",' + "[" * 30 + "]" * 30 + "]",
        GRIDS,
        ["EPSG:4326"],
        7.5,
        None,
    ],
)
def test_a_crs_that_is_no_code_urn_or_wkt_is_refused_unasked(tmp_path, name, capfd):
    refuse("^ignition.path must ", read_ignition, geojson(tmp_path, point(), name), GRID)
    assert capfd.readouterr() == ("", "")


@pytest.mark.parametrize("wkt", [GRIDS, "PROJCS[" * 3000, 'GEOGCS["x",' + "[" * 30 + "]" * 31, "GEOGCS" + "[]" * 6000])
def test_wkt_that_names_a_file_or_is_deep_or_long_never_comes_to_proj(tmp_path, wkt):
    refuse("must have a CRS that is known, an EPSG code", read_ignition, geojson(tmp_path, point(), wkt), GRID)


def test_a_raster_s_own_crs_names_no_file_either(tmp_path):
    asc(tmp_path / "fuel.asc", flat(1), prj=GRIDS)
    refuse("^fuel must have a .* names no file", ground, tmp_path)


def point(x=5e5 + 165, y=4.5e6 - 75):
    return {"type": "Point", "coordinates": [x, y]}


def geojson(folder, geometry, crs="EPSG:32610", **properties):
    """Write one feature, with the CRS as QGIS states it."""
    feature = {"type": "Feature", "properties": properties, "geometry": geometry}
    document = {
        "type": "FeatureCollection",
        "crs": {"type": "name", "properties": {"name": crs}},
        "features": [feature],
    }
    path = folder / "fire.geojson"
    path.write_text(json.dumps(document))
    return path


@pytest.mark.parametrize(
    "crs, to",
    [
        ("EPSG:32610", 32610),
        ("urn:ogc:def:crs:EPSG::32610", 32610),
        ("urn:ogc:def:crs:EPSG:9.9.1:3857", 3857),
        ("urn:ogc:def:crs:OGC:1.3:CRS84", 4326),
        ("OGC:CRS84", 4326),
        (UTM.to_wkt(), 32610),
        (rasterio.crs.CRS.from_epsg(3857).to_wkt(), 3857),
        ("ESRI:102008", "ESRI:102008"),
    ],
)
def test_codes_urns_and_wkt_place_a_fire(tmp_path, crs, to):
    from rasterio.warp import transform

    to = f"EPSG:{to}" if isinstance(to, int) else to
    (x,), (y,) = transform(UTM, to, [5e5 + 165], [4.5e6 - 75])
    assert np.argwhere(read_ignition(geojson(tmp_path, point(x, y), crs), GRID)).tolist() == [[2, 5]]


def test_the_first_version_of_geojson_s_crs_is_a_code(tmp_path):
    path = geojson(tmp_path, point())
    document = json.loads(path.read_text()) | {"crs": {"type": "EPSG", "properties": {"code": 32610}}}
    path.write_text(json.dumps(document))
    assert read_ignition(path, GRID).sum() == 1


@pytest.mark.parametrize(
    "text, words",
    [
        ('{"type":"Point","coordinates":[500165,4499925]}', "must be in longitude and latitude where it states no CRS"),
        ('{"type":"Point","coordinates":[NaN,40]}', "must have finite coordinates"),
        ('{"type":"Point","coordinates":[1e999,40]}', "must have finite coordinates"),
        ('{"type":"Point","coordinates":[true,40]}', "must hold points, lines or polygons"),
        ('{"type":"Point","coordinates":' + "[" * 400 + "1,2" + "]" * 400 + "}", "must hold points, lines or polygons"),
        ('{"type":"Feature","geometry":' + '{"type":"GeometryCollection","geometries":[' * 50
         + '{"type":"Point","coordinates":[1,2]}' + "]}" * 50 + "}", "must hold points, lines or polygons"),
        ('{"type":"Feature","properties":[1],"geometry":null}', "properties are not an object"),
        ('{"type":"Feature","geometry":null}', "has 0, none of them there"),
        ('{"type":"Feature","crs":{"type":"link","properties":{"href":"x"}},"geometry":null}', "crs has no name"),
        ('{"type":"Point","coordinates":[1,2]' + " [" * 1_000_001, "must have at most 1000000 corners"),
        ("\x00" * 40, "must be a GeoJSON file"),
    ],
)  # fmt: skip
def test_broken_geojson_is_refused_in_one_line(tmp_path, text, words, capfd):
    path = tmp_path / "fire.geojson"
    path.write_text(text)
    refuse(f"^ignition.path .*{words}", read_ignition, path, GRID)
    assert capfd.readouterr() == ("", "")


def test_a_byte_order_mark_and_features_without_a_geometry_are_let_pass(tmp_path):
    document = json.loads(geojson(tmp_path, point()).read_text())
    document["features"].append({"type": "Feature", "properties": None, "geometry": None})
    path = tmp_path / "fire.json"
    path.write_bytes(b"\xef\xbb\xbf" + json.dumps(document).encode())
    assert np.argwhere(read_ignition(path, GRID)).tolist() == [[2, 5]]


# --- Rasters of ignitions


@pytest.mark.parametrize(
    "values, dtype, nodata, lit",
    [
        ((-9999, 1), "int16", None, 1),
        ((255, 1), "uint8", 255, 1),
        ((0, 255), "uint8", None, 1),
        ((math.nan, 3), "float32", None, 1),
        ((-3.4028235e38, 0.5), "float32", None, 1),
        ((math.inf, 1), "float32", None, 1),
        ((255, 1), "uint8", None, "must say what is nodata .* marks cells by 1 and by 255"),
        ((255, 0), "uint8", None, r"must say what is nodata .* marks \d+ of \d+ cells by 255"),
        ((255, 0), "uint8", 255, "must mark a cell of the map"),
        ((32767, 1), "int16", None, "must say what is nodata"),
        ((3.4028235e38, 1), "float32", None, "must say what is nodata"),
        ((-9999, 0), "int16", None, "must mark a cell of the map"),
    ],
)
def test_finite_numbers_over_zero_light_cells(tmp_path, values, dtype, nodata, lit):
    marks = flat(values[0], dtype)
    marks[3, 4] = values[1]
    path = tif(tmp_path / "lit.tif", marks, nodata=nodata)
    if isinstance(lit, str):
        refuse(f"^ignition.path {lit}", read_ignition, path, GRID)
    else:
        assert np.argwhere(read_ignition(path, GRID)).tolist() == [[3, 4]]


def test_an_ascii_grid_without_a_nodata_line_lights_what_it_marks(tmp_path):
    marks = flat(-9999)
    marks[3, 4] = 1
    path = asc(tmp_path / "lit.asc", marks, "xllcorner 500000\nyllcorner 4499400\ncellsize 30\n")
    assert np.argwhere(read_ignition(path, GRID)).tolist() == [[3, 4]]


# --- Codes of fuel that a law lacks


def codes(folder, west, east):
    values = flat(west)
    values[:, 10:] = east
    tif(folder / "fuel.tif", values)
    return folder


def test_codes_that_the_fuel_model_lacks_are_named_with_their_cells(tmp_path):
    source = ground(codes(tmp_path, 102, 312), table={102: "grassland", 312: "forest"})
    told = (
        r"312 \(200 cells, forest\) is no fuel of fbfm40 and will not burn: give fire.fuel_models or fire.fuel_of_cover"
    )
    refuse(told, RateFire().on, source)
    law = RateFire(fuel_of_cover=(98, 161, 101, 165, 99)).on(source)
    assert law.bed.fuel(source(keys(1)))[0, 0, [0, 10]].tolist() == [101, 165]
    RateFire().on(ground(tmp_path, table={102: "grassland", 312: "bare"}))  # which says that it does not burn


@pytest.mark.parametrize(
    "model, code, meant",
    [("fbfm13", 12, "forest"), ("fbfm40", 122, "grassland"), ("fbp", 411, "forest"), ("fbfm40", 99, "bare")],
)
def test_classes_that_are_codes_of_fuel_by_chance_are_refused(tmp_path, model, code, meant):
    called = "grassland" if meant != "grassland" else "forest"
    source = ground(codes(tmp_path, code, code), table={code: called})
    words = rf"{code} \(400 cells, {called}\), for {model} {code} {meant}: give fire.fuel_of_cover"
    refuse(f"^landscape.table must say of codes what {model} does, got {words}", RateFire(model=model).on, source)
    by_cover = RateFire(model=model, fuel_of_cover=(98, 1, 2, 3, 99)).on(source)
    assert (by_cover.bed.fuel(source(keys(1))) == (2 if called == "grassland" else 3)).all()


def test_a_law_keeps_to_the_cover_in_a_world_and_tells_its_fuels(tmp_path):
    from warp_torchrl.world.world import World

    source = ground(codes(tmp_path, 102, 93), table="fbfm40", ages="oldest")
    assert RateFire().told_fuel(source(keys(1))) == "102 (200); no fuel: 93 (200)"
    own = ground(codes(tmp_path, 41, 71), table={41: "forest", 71: "grassland"}, ages="oldest")
    world = World(landscape=own, fire=RateFire(fuel_of_cover=(98, 161, 102, 165, 99)))
    assert world.fire.told_fuel(own(keys(1))) == "102 (200), 165 (200); no fuel: none"
    assert torch.equal(world.fire.bed.fuel(own(keys(1))), world.fire.over(own, world.wind, 30.0).bed.fuel(own(keys(1))))
