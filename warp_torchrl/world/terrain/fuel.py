"""Cover of the codes of a fuel or land-cover layer: presets, and users' tables."""

from collections.abc import Mapping
from os import PathLike
from pathlib import Path

import numpy as np

from warp_torchrl.system.foreign import Foreign
from warp_torchrl.system.foreign_yaml import read_words
from warp_torchrl.validation import did_you_mean
from warp_torchrl.world.state.state import Cover

_NON_BURNABLE = {91: Cover.BARE, 92: Cover.BARE, 93: Cover.GRASSLAND, 98: Cover.LAKE, 99: Cover.BARE}

FBFM13: Mapping[int, int] = (
    dict.fromkeys(range(1, 8), Cover.GRASSLAND) | dict.fromkeys(range(8, 14), Cover.FOREST) | _NON_BURNABLE
)
"""Cover of each LANDFIRE code of the 13 fuel models (Anderson 1982, USDA Forest Service INT-122).

Grass 1-3 is grassland, and so is shrub 4-7, which carries fire faster than any litter or slash; timber litter 8-10
and slash 11-13 are forest; urban 91, snow or ice 92 and barren 99 bare; water 98 lake. Agriculture 93, which LANDFIRE
calls non-burnable, is grassland: stubble and cured crops carry fire. Nothing is wetland.
"""

FBFM40: Mapping[int, int] = (
    dict.fromkeys((*range(101, 110), *range(121, 125), *range(141, 150)), Cover.GRASSLAND)
    | dict.fromkeys((*range(161, 166), *range(181, 190), *range(201, 205)), Cover.FOREST)
    | _NON_BURNABLE
)
"""Cover of each LANDFIRE code of the 40 fuel models (Scott and Burgan 2005, USDA Forest Service RMRS-GTR-153).

Grass GR 101-109, grass-shrub GS 121-124 and shrub SH 141-149 are grassland; timber-understory TU 161-165, timber
litter TL 181-189 and slash-blowdown SB 201-204 forest; the non-burnable NB 91, 92, 93, 98 and 99 as in ``FBFM13``.
"""

WORLDCOVER: Mapping[int, int] = (
    dict.fromkeys((10,), Cover.FOREST)
    | dict.fromkeys((20, 30, 40), Cover.GRASSLAND)
    | dict.fromkeys((90, 95), Cover.WETLAND)
    | dict.fromkeys((50, 60, 70, 100), Cover.BARE)
    | {80: Cover.LAKE}
)
"""Cover of each class of ESA WorldCover (Zanaga et al. 2022, WorldCover 10 m 2021 v200, product user manual).

Tree cover 10 is forest; shrubland 20, grassland 30 and cropland 40 grassland, as shrub and agriculture are in
``FBFM13``; herbaceous wetland 90 and mangroves 95 wetland; permanent water 80 lake; built-up 50, bare or sparse 60,
snow and ice 70, and moss and lichen 100, too thin to carry a front, bare. 0 is its nodata, and no class.
"""

NLCD: Mapping[int, int] = (
    dict.fromkeys((41, 42, 43), Cover.FOREST)
    | dict.fromkeys((51, 52, 71, 72, 73, 74, 81, 82), Cover.GRASSLAND)
    | dict.fromkeys((90, 95), Cover.WETLAND)
    | dict.fromkeys((12, 21, 22, 23, 24, 31), Cover.BARE)
    | {11: Cover.LAKE}
)
"""Cover of each class of the USGS National Land Cover Database (Yang et al. 2018, legend of NLCD 2016).

Forests 41-43 are forest; shrub 51, 52, herbs 71-74, pasture 81 and crops 82 grassland; wetlands 90, 95 wetland; open
water 11 lake; ice 12, developed 21-24 and barren 31 bare. 0 is its nodata, and no class.
"""

CORINE: Mapping[int, int] = (
    dict.fromkeys((311, 312, 313), Cover.FOREST)
    | dict.fromkeys((141, 211, 212, 213, 221, 222, 223, 231, 241, 242, 243, 244), Cover.GRASSLAND)
    | dict.fromkeys((321, 322, 323, 324, 333), Cover.GRASSLAND)
    | dict.fromkeys((411, 412, 421), Cover.WETLAND)
    | dict.fromkeys((111, 112, 121, 122, 123, 124, 131, 132, 133, 142, 331, 332, 334, 335, 422, 423), Cover.BARE)
    | dict.fromkeys((511, 512, 521, 522, 523), Cover.LAKE)
)
"""Cover of each class of CORINE Land Cover, of three digits (Kosztra et al. 2019, CLC nomenclature guidelines).

Forests 311-313 are forest; green urban areas 141, agriculture 211-244, grass, heath, shrub and sparse vegetation
321-324 and 333 grassland; marshes, bogs and salt marshes 411, 412, 421 wetland; water 511-523 lake; artificial
surfaces, sand, rock, burnt areas, ice, salines and flats bare.
"""

_CONIFER, _DECIDUOUS, _SLASH, _OPEN = range(1, 8), range(11, 14), range(21, 24), (31, 32)

FBP: Mapping[int, int] = (
    dict.fromkeys((*_CONIFER, *_DECIDUOUS, *_SLASH, *range(40, 100, 10), *range(400, 1000)), Cover.FOREST)
    | dict.fromkeys(_OPEN, Cover.GRASSLAND)
    | dict.fromkeys((0, 99, 100, 101, 103, 104, 105, 106), Cover.BARE)
    | {102: Cover.LAKE}
)
"""Cover of each code of Canada's FBP fuel types (Forestry Canada 1992, ST-X-3), as the national fuel grid has them.

Conifers C-1 to C-7 1-7, deciduous D-1 and D-2 11-13, slash S-1 to S-3 21-23 and mixedwood M-1 to M-4 40, 50 .. 90 are
forest, and so are 400-999, mixedwood whose last two digits are the per cent of conifer or dead fir; grass O-1a 31 and
O-1b 32 is grassland; water 102 lake; what is no fuel, not known or urban, 0, 99, 100, 101 and 103-106, bare.
"""

TABLES = {
    "fbfm13": FBFM13,
    "fbfm40": FBFM40,
    "fbp": FBP,
    "worldcover": WORLDCOVER,
    "nlcd": NLCD,
    "corine": CORINE,
}
"""The presets by name."""
LAND_COVER = ("worldcover", "nlcd", "corine")
"""Those whose codes are classes of land cover, and no fuel models: laws of rates of spread go by the cover there."""
NO_FUEL_CODE = 99
"""Fuel code of cells that are not known: no fuel in FBFM13, FBFM40 and FBP alike."""
_UNDECLARED = (255, 32767, 65535)


def code_table(table: str | PathLike[str] | Mapping[int, int | str]) -> Mapping[int, int]:
    """Return the cover of each class code.

    Args:
        table: A preset of ``TABLES``, whole codes to ``Cover`` codes or names, or a yaml file of those.

    Raises:
        ValueError: If it is none of these, or a code comes twice.
    """
    pairs = _read_pairs(table) if str(table).endswith((".yaml", ".yml")) else _given_pairs(table)
    try:
        covers = {int(str(code)): _cover(to) for code, to in pairs}
        if not 0 < len(covers) == len(pairs):
            raise ValueError
    except (KeyError, TypeError, ValueError):
        raise ValueError(f"table must {_RULE}, got {table}{did_you_mean(table, TABLES)}") from None
    return covers


_RULE = (
    f"be one of {', '.join(TABLES)}, a .yaml file, or map whole codes to 0..{max(Cover)} "
    f"({', '.join(cover.name.lower() for cover in Cover)}), each once"
)


def _cover(to: object) -> Cover:
    text = str(to)
    return Cover(int(text)) if text.isdigit() else Cover[text.upper()]


def _given_pairs(table: object) -> list[tuple[object, object]]:
    mapping = TABLES.get(table) if isinstance(table, str) else table
    return list(mapping.items()) if isinstance(mapping, Mapping) else []


def _read_pairs(path: object) -> list[tuple[object, object]]:
    """Return the pairs of a yaml file's mapping, as texts."""
    try:
        content = read_words(Path(str(path)))
    except (OSError, Foreign) as error:
        reason = " ".join(str(error).split())
        raise ValueError(f"table must name a yaml file that can be read, {path} cannot: {reason}") from None
    return list(content.items()) if isinstance(content, dict) else []


def is_code(codes: np.ndarray, table: Mapping[int, int]) -> np.ndarray:
    """Return which codes may be classes, bool: negative numbers outside of the table mean unknown."""
    below = codes < 0
    return ~below | np.isin(codes, list(table)) if below.any() else ~below


def to_cover(codes: np.ndarray, known: np.ndarray, table: Mapping[int, int]) -> np.ndarray:
    """Return the cover of each cell, uint8 [H, W]; bare where it is not known.

    Args:
        codes: Class codes, any real dtype, [H, W].
        known: Where they are known, bool [H, W].
        table: From ``code_table``.

    Raises:
        ValueError: If a code is not whole, or not in the table.
    """
    broken = known & (codes != np.rint(codes))
    if broken.any():
        raise ValueError(f"fuel must hold whole class codes, got {codes[broken][0]}")
    cover = np.full(codes.shape, 255, np.uint8)
    for code, to in table.items():
        cover[codes == code] = to
    strange = np.unique(codes[known & (cover == 255)])
    if strange.size:
        listed = ", ".join(f"{code:.0f}" for code in strange[:50]) + ", ..." * (strange.size > 50)
        fits = [name for name, preset in TABLES.items() if set(np.unique(codes[known])) <= preset.keys()]
        hint = f"; table={' or table='.join(fits)} has them" if fits else ""
        if (undeclared := set(strange.tolist()) & set(_UNDECLARED)) and not fits:
            largest = f"{min(undeclared):.0f}"
            hint = f"; if {largest} is nodata, gdal_edit -a_nodata {largest} makes the file say so"
        raise ValueError(f"table must have every code of fuel, it lacks {strange.size}: {listed}{hint}")
    return np.where(known, cover, np.uint8(Cover.BARE))
