"""What the codes of a fuel or land-cover layer are to the world: presets, tables of a user's own, and the covers."""

from collections.abc import Mapping

import numpy as np

from warp_torchrl.world.state import Cover

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

TABLES = {"fbfm13": FBFM13, "fbfm40": FBFM40, "worldcover": WORLDCOVER}
"""The presets by name."""


def code_table(table: str | Mapping[int, int | str]) -> Mapping[int, int]:
    """Return the cover of each class code.

    Args:
        table: A preset of ``TABLES``, or whole codes to ``Cover`` codes or names.

    Raises:
        ValueError: If it is neither, or a code comes twice.
    """
    try:
        pairs = TABLES[table].items() if isinstance(table, str) else table.items()
        covers = {int(str(code)): Cover[to.upper()] if isinstance(to, str) else Cover(to) for code, to in pairs}
        if not 0 < len(covers) == len(pairs):
            raise ValueError
    except (AttributeError, KeyError, TypeError, ValueError):
        names = ", ".join(cover.name.lower() for cover in Cover)
        rule = f"one of {', '.join(TABLES)}, or map whole codes to 0..{max(Cover)} ({names})"
        raise ValueError(f"table must be {rule}, got {table}") from None
    return covers


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
        raise ValueError(f"table must have every code of fuel, it lacks {strange.size}: {listed}{hint}")
    return np.where(known, cover, np.uint8(Cover.BARE))
