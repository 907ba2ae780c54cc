"""The fuel types of the Canadian Forest Fire Behavior Prediction (FBP) System and their codes on a map.

Constants: Forestry Canada Fire Danger Group 1992, ST-X-3, tables 6 to 8 and eqs. 9 to 25; Wotton, Alexander and
Taylor 2009, GLC-X-10, for M-3, M-4, D-2 and the crown of every type.

Codes are those of Canada's national fuel grid and of the lookup tables that Prometheus and others read:

    1..7 C-1..C-7    11 D-1    12 D-2    13 D-1 or D-2    21..23 S-1..S-3    31 O-1a    32 O-1b
    40 M-1    50 M-2    60 M-1 or M-2    70 M-3    80 M-4    90 M-3 or M-4
    400..499, 500..599, ... 900..999: as 40, 50, ... 90; the last two digits are the per cent of conifer (of dead fir)

Everything else is no fuel: 0, 99, 100..106 (102 is water), -9999.
"""

from dataclasses import dataclass
from typing import NamedTuple

import torch
from torch import Tensor

CURING = 80.0
"""Cured grass [per cent] where nothing says it, as the R package cffdrs has it."""
Number = float | Tensor
"""A number, or a tensor of them that broadcasts with the map of fuels."""


class FuelType(NamedTuple):
    """One fuel type of the system."""

    a: float  # rate of spread in an endless wind [m/min], ST-X-3 table 6
    b: float  # how fast the rate grows with the initial spread index
    c: float  # how late it grows
    q: float  # share of the rate at a buildup index of 50, ST-X-3 table 7
    bui0: float  # buildup index at which the effect is 1
    crown_base: float = 0.0  # height of the crowns' base [m], ST-X-3 table 8
    crown_load: float = 0.0  # fuel in the crowns [kg/m2]; 0: no crowns
    load: float = 0.0  # fuel that burns on the surface at a high buildup index [kg/m2], eqs. 10 to 25
    load_rate: float = 0.0  # how fast it grows with the buildup index
    load_power: float = 1.0
    second_load: float = 0.0  # a second layer of it [kg/m2]
    second_load_rate: float = 0.0


_M3 = FuelType(120, 0.0572, 1.40, 0.80, 50, 6, 0.80, 5.0, 0.0115)
_D1 = FuelType(30, 0.0232, 1.60, 0.90, 32, 0, 0.00, 1.5, 0.0183)
_C2 = FuelType(110, 0.0282, 1.5, 0.70, 64, 3, 0.80, 5.0, 0.0115)
_M1 = _C2._replace(q=0.80, bui0=50, crown_base=6, second_load=1.5, second_load_rate=0.0183)
_O1A = FuelType(190, 0.0310, 1.4, 1.0, 1)

FUEL_TYPES: dict[str, FuelType] = {
    "C-1": FuelType(90, 0.0649, 4.5, 0.90, 72, 2, 0.75),
    "C-2": _C2,
    "C-3": FuelType(110, 0.0444, 3.0, 0.75, 62, 8, 1.15, 5.0, 0.0164, 2.24),
    "C-4": FuelType(110, 0.0293, 1.5, 0.80, 66, 4, 1.20, 5.0, 0.0164, 2.24),
    "C-5": FuelType(30, 0.0697, 4.0, 0.80, 56, 18, 1.20, 5.0, 0.0149, 2.48),
    "C-6": FuelType(30, 0.0800, 3.0, 0.80, 62, 7, 1.80, 5.0, 0.0149, 2.48),
    "C-7": FuelType(45, 0.0305, 2.0, 0.85, 106, 10, 0.50, 1.5, 0.0201),
    "D-1": _D1,
    "D-2": _D1._replace(a=0.2 * _D1.a),  # GLC-X-10: a fifth of D-1, and nothing below a buildup index of 80
    "S-1": FuelType(75, 0.0297, 1.3, 0.75, 38, 0, 0.0, 4.0, 0.025, 1.0, 4.0, 0.034),
    "S-2": FuelType(40, 0.0438, 1.7, 0.75, 63, 0, 0.0, 10.0, 0.013, 1.0, 6.0, 0.060),
    "S-3": FuelType(55, 0.0829, 3.2, 0.75, 31, 0, 0.0, 12.0, 0.0166, 1.0, 20.0, 0.0210),
    "O-1a": _O1A,
    "O-1b": _O1A._replace(a=250, b=0.0350, c=1.7),
    "M-1": _M1,  # its conifers spread as C-2
    "M-2": _M1,
    "M-3": _M3,
    "M-4": _M3._replace(a=100, b=0.0404, c=1.48),
}
"""Every fuel type that spreads, by the system's name. Of the mixed ones (M) it is the conifers or the dead fir."""

_NAMES = (*FUEL_TYPES, "none")
_CODES = {
    **{number: f"C-{number}" for number in range(1, 8)},
    **{20 + number: f"S-{number}" for number in range(1, 4)},
    **{11: "D-1", 12: "D-2", 31: "O-1a", 32: "O-1b"},
}
_MIXED = {4: ("M-1", "M-1"), 5: ("M-2", "M-2"), 6: ("M-1", "M-2"), 7: ("M-3", "M-3"), 8: ("M-4", "M-4")} | {
    9: ("M-3", "M-4")
}
_TABLE = torch.tensor([*FUEL_TYPES.values(), FuelType(0, 1, 1, 1, 1)], dtype=torch.float32).T.contiguous()


def _codes(green: bool) -> Tensor:
    """Return the place of each code, 0..999, in the table; int64 [1000]."""
    names = _CODES | {13: "D-2" if green else "D-1"}
    for tens, kinds in _MIXED.items():
        name = kinds[green]
        names |= {10 * tens: name} | {code: name for code in range(100 * tens, 100 * tens + 100)}
    return torch.tensor([_NAMES.index(names.get(code, "none")) for code in range(1000)])


_LEAFLESS, _GREEN = _codes(green=False), _codes(green=True)


@dataclass(frozen=True)
class FbpFuels:
    """The constants of the fuel in each cell; all fields of the map's shape, float32 unless stated otherwise.

    Every fuel is a mixture of two: `share` of a first one, and the rest leafless aspen (D-1) that spreads at `aspen`
    times its rate. An unmixed fuel has a share of 1.
    """

    a: Tensor  # rate of the first fuel in an endless wind, times the curing of grass [m/min]
    b: Tensor
    c: Tensor
    q: Tensor
    bui0: Tensor
    crown_base: Tensor  # [m]
    crown_load: Tensor  # times the share of the first fuel [kg/m2]
    load: Tensor  # [kg/m2]
    load_rate: Tensor
    load_power: Tensor
    second_load: Tensor  # [kg/m2]
    second_load_rate: Tensor
    share: Tensor  # 0..1
    aspen: Tensor  # 1 before leaves are out, 0.2 after
    constant_load: Tensor  # what burns in any moisture: grass [kg/m2]
    is_c1: Tensor  # bool
    is_c6: Tensor  # bool
    is_c7: Tensor  # bool
    is_d2: Tensor  # bool
    is_grass: Tensor  # bool


def fbp_fuels(
    fuel: Tensor,
    *,
    curing: Number = 80.0,
    percent_conifer: Number = 50.0,
    percent_dead_fir: Number = 35.0,
    grass_load: Number = 0.35,
    green: bool = False,
) -> FbpFuels:
    """Return the constants of each cell's fuel.

    The defaults are those of the reference implementation, the R package cffdrs. Without leaves is how fuel maps that
    say D-1/D-2 and M-1/M-2 are read where no date of green-up is known: it is the faster of the two.

    Args:
        fuel: Codes of fuel types, whole numbers of any shape; a code that is not known is no fuel.
        curing: Cured grass in O-1 [per cent].
        percent_conifer: Conifers in M-1 and M-2 whose code does not say it [per cent].
        percent_dead_fir: Dead balsam fir in M-3 and M-4 whose code does not say it [per cent].
        grass_load: Fuel in grass [kg/m2].
        green: Whether leaves are out: whether 13 is D-2 (not D-1), 60 M-2 (not M-1) and 90 M-4 (not M-3).

    Raises:
        ValueError: If the codes are not whole numbers, or a per cent or load lies out of its range.
    """
    if fuel.is_floating_point() or fuel.dtype == torch.bool:
        raise ValueError(f"fuel must be codes of an integer dtype, got {str(fuel.dtype).removeprefix('torch.')}")
    given = {"curing": curing, "percent_conifer": percent_conifer, "percent_dead_fir": percent_dead_fir}
    given |= {"grass_load": grass_load}
    state = {name: _checked(name, value).to(fuel.device) for name, value in given.items()}
    known = (fuel >= 0) & (fuel < 1000)
    code = torch.where(known, fuel, 0).long()
    kind = (_GREEN if green else _LEAFLESS).to(fuel.device)[code]
    columns = {
        name: column[kind] for name, column in zip(FuelType._fields, _TABLE.to(fuel.device).unbind(), strict=True)
    }
    return _mix(kind, code, columns, **state)


def _mix(
    kind: Tensor,
    code: Tensor,
    columns: dict[str, Tensor],
    *,
    curing: Tensor,
    percent_conifer: Tensor,
    percent_dead_fir: Tensor,
    grass_load: Tensor,
) -> FbpFuels:
    """Return the constants with the mixtures and the state of the grass in them."""
    m1, m2, m3, m4 = ((kind == _NAMES.index(name)) for name in ("M-1", "M-2", "M-3", "M-4"))
    grass = (kind == _NAMES.index("O-1a")) | (kind == _NAMES.index("O-1b"))
    boreal, fir = m1 | m2, m3 | m4
    told = torch.where(fir, percent_dead_fir, percent_conifer)
    percent = torch.where(code >= 400, (code % 100).float(), told)
    share = torch.where(boreal | fir, percent / 100, 1.0)
    columns |= {
        "a": columns["a"] * torch.where(grass, curing_effect(curing), 1.0),
        "crown_load": columns["crown_load"] * share,
        "load": columns["load"] * torch.where(boreal, share, 1.0),
        "second_load": columns["second_load"] * torch.where(boreal, 1 - share, 1.0),
    }
    return FbpFuels(
        **columns,
        share=share,
        aspen=torch.where(m2 | m4, 0.2, 1.0),
        constant_load=torch.where(grass, grass_load, 0.0),
        is_grass=grass,
        **{f"is_{name.lower().replace('-', '')}": kind == _NAMES.index(name) for name in ("C-1", "C-6", "C-7", "D-2")},
    )


def curing_effect(curing: Tensor) -> Tensor:
    """Return the share of its rate that grass spreads at, by its curing [per cent] (GLC-X-10 eqs. 35a and 35b)."""
    return torch.where(curing < 58.8, 0.005 * torch.expm1(0.061 * curing), 0.176 + 0.02 * (curing - 58.8))


def _checked(name: str, value: Number) -> Tensor:
    tensor = torch.as_tensor(value, dtype=torch.float32)
    if not bool(((tensor >= 0) & (tensor <= 100)).all()):
        shown = value if tensor.numel() == 1 else f"{tensor.min():g} to {tensor.max():g}"
        raise ValueError(f"{name} must be in [0, 100], got {shown}")
    return tensor
