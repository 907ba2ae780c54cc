"""Checks of a map's fuel codes against its fuel model."""

from collections.abc import Mapping

import torch
from torch import Tensor

from warp_torchrl.world.behaviour.fbp_fuels import fbp_fuels
from warp_torchrl.world.behaviour.fuel_codes import FBP_CODES
from warp_torchrl.world.behaviour.fuel_models import FuelTable
from warp_torchrl.world.state.state import Cover
from warp_torchrl.world.terrain.fuel import NO_FUEL_CODE, TABLES

Cells = Mapping[tuple[int, int], int]
"""How many cells of a map have each pair of a fuel code and a cover."""
_NON_BURNABLE = (91, 92, 93, 98, NO_FUEL_CODE)  # of LANDFIRE's fuel models
_SHOWN = 5  # codes that a message names


def has_own_table(landscape: object) -> bool:
    """Return whether a user said what the codes of a landscape are."""
    table = getattr(landscape, "table", None)
    return table is not None and not (isinstance(table, str) and table in TABLES)


def check_codes(landscape: object, table: FuelTable | None, model: str, own_models: bool) -> None:
    """Refuse a landscape where trees stand on fuel codes that the model lacks, or takes for something else.

    Args:
        landscape: A source; one without ``fuel_codes`` has none to be asked.
        table: The fuel models; None is the Canadian system.
        model: Its name.
        own_models: Whether the fuel models are a user's own.

    Raises:
        ValueError: With codes, cells and covers, and what to give.
    """
    cells: Cells = landscape.fuel_codes() if hasattr(landscape, "fuel_codes") else {}
    by_cover = has_own_table(landscape)
    lacking = {pair: count for pair, count in cells.items() if not _is_known(pair[0], table)}
    if lacking:
        called = "fire.fuel_models" if own_models else model
        ways = [*["fire.fuel_models"] * (table is not None), *["fire.fuel_of_cover"] * by_cover]
        hint = f": give {' or '.join(ways)}" if ways else ""
        verb = "is no fuel" if len(lacking) == 1 else "are no fuels"
        told = f"{_listed(lacking)} {verb} of {called} and will not burn{hint}"
        raise ValueError(f"landscape.fuel must hold codes of {called}, {told}")
    other = {pair: count for pair, count in cells.items() if by_cover and not own_models and _differs(pair, model)}
    if other:
        meant = ", ".join(f"{code} {_name(TABLES[model][code])}" for code, _ in list(other)[:_SHOWN])
        got = f"{_listed(other)}, for {model} {meant}"
        hint = f"give fire.fuel_of_cover for classes of land cover, or landscape.table={model} for fuels"
        raise ValueError(f"landscape.table must say of codes what {model} does, got {got}: {hint}")


def check_fuel(fuel: Tensor, table: FuelTable | None, model: str) -> None:
    """Refuse a map of fuel codes, any shape, of which the model lacks some.

    Raises:
        ValueError: With codes and cells.
    """
    codes, counts = fuel.unique(return_counts=True)
    lacking = [f"{code} ({count} cells)" for code, count in zip(codes.tolist(), counts.tolist(), strict=True)
               if not _is_known(code, table)]  # fmt: skip
    if lacking:
        rule = f"fuel must hold codes of {model}, {NO_FUEL_CODE} where nothing burns"
        raise ValueError(f"{rule}, got {', '.join(lacking[:_SHOWN])}{', ...' * (len(lacking) > _SHOWN)}")


def told_fuel(fuel: Tensor, table: FuelTable | None) -> str:
    """Return in words how many cells each fuel code has, any shape, those of no fuel behind."""
    codes, counts = fuel.unique(return_counts=True)
    burns = fbp_fuels(codes.long()).a > 0.0 if table is None else table.fuels.load[table.index(codes)].sum(-1) > 0.0
    named = [f"{code} ({count})" for code, count in zip(codes.tolist(), counts.tolist(), strict=True)]
    fuels = [each for each, burned in zip(named, burns.tolist(), strict=True) if burned]
    rest = [each for each, burned in zip(named, burns.tolist(), strict=True) if not burned]
    return f"{', '.join(fuels) or 'none'}; no fuel: {', '.join(rest) or 'none'}"


def _is_known(code: int, table: FuelTable | None) -> bool:
    known = FBP_CODES if table is None else torch.cat((table.codes, torch.tensor(_NON_BURNABLE)))
    return bool((known == code).any())


def _differs(pair: tuple[int, int], model: str) -> bool:
    """Return whether a model takes a code for another cover; wetland is none of its covers, and may be of any."""
    code, cover = pair
    return cover != int(Cover.WETLAND) and TABLES[model].get(code, cover) != cover


def _listed(cells: Cells) -> str:
    shown = [f"{code} ({count} cells, {_name(cover)})" for (code, cover), count in list(cells.items())[:_SHOWN]]
    return ", ".join(shown) + ", ..." * (len(cells) > _SHOWN)


def _name(cover: int) -> str:
    return Cover(cover).name.lower()
