"""The standard fuel models: the 13 of Anderson (1982) and the 40 of Scott and Burgan (2005).

Codes are those of LANDFIRE's maps. Anderson's table says "live" without a kind: here it is herbaceous, as in the
package pyretechnics. BehavePlus takes that of models 4, 5, 7 and 10 for woody; give both moistures alike to burn as it
does. None of the 13 cures.
"""

from collections.abc import Sequence
from dataclasses import replace

from warp_torchrl.system.modes import kept
from warp_torchrl.world.behaviour.fuel_models import TON_PER_ACRE, UNBURNABLE, FuelModel, FuelTable, fuel_table

NOT_BURNABLE = {"NB1": 91, "NB2": 92, "NB3": 93, "NB8": 98, "NB9": 99}
"""Urban, snow and ice, agriculture, water, bare ground; in both sets."""

# Anderson 1982, INT-122, in the units and digits of Albini 1976, INT-30. Loads of 1, 10, 100 h, live herbaceous and
# woody [lb/ft2], ratio of 1 h and of live fuel [1/ft], depth [ft], moisture of extinction [%].
_ANDERSON = {
    1: (0.034, 0.000, 0.000, 0.000, 0.000, 3500, 1500, 1.0, 12),
    2: (0.092, 0.046, 0.023, 0.023, 0.000, 3000, 1500, 1.0, 15),
    3: (0.138, 0.000, 0.000, 0.000, 0.000, 1500, 1500, 2.5, 25),
    4: (0.230, 0.184, 0.092, 0.230, 0.000, 2000, 1500, 6.0, 20),
    5: (0.046, 0.023, 0.000, 0.092, 0.000, 2000, 1500, 2.0, 20),
    6: (0.069, 0.115, 0.092, 0.000, 0.000, 1750, 1500, 2.5, 25),
    7: (0.052, 0.086, 0.069, 0.017, 0.000, 1750, 1550, 2.5, 40),
    8: (0.069, 0.046, 0.115, 0.000, 0.000, 2000, 1500, 0.2, 30),
    9: (0.134, 0.019, 0.007, 0.000, 0.000, 2500, 1500, 0.2, 25),
    10: (0.138, 0.092, 0.230, 0.092, 0.000, 2000, 1500, 1.0, 25),
    11: (0.069, 0.207, 0.253, 0.000, 0.000, 1500, 1500, 1.0, 15),
    12: (0.184, 0.644, 0.759, 0.000, 0.000, 1500, 1500, 2.3, 20),
    13: (0.322, 1.058, 1.288, 0.000, 0.000, 1500, 1500, 3.0, 25),
}

# Scott and Burgan 2005, RMRS-GTR-153, table 7. Loads of 1, 10, 100 h, live herbaceous and woody [short tons/acre],
# ratio of 1 h, live herbaceous and live woody [1/ft], depth [ft], moisture of extinction [%]. A model with herbaceous
# load is dynamic. A ratio of fuel that is not there (9999 in the source) stands as 1500.
_SCOTT_BURGAN = {
    "GR1": (101, 0.10, 0.00, 0.00, 0.30, 0.00, 2200, 2000, 1500, 0.4, 15),
    "GR2": (102, 0.10, 0.00, 0.00, 1.00, 0.00, 2000, 1800, 1500, 1.0, 15),
    "GR3": (103, 0.10, 0.40, 0.00, 1.50, 0.00, 1500, 1300, 1500, 2.0, 30),
    "GR4": (104, 0.25, 0.00, 0.00, 1.90, 0.00, 2000, 1800, 1500, 2.0, 15),
    "GR5": (105, 0.40, 0.00, 0.00, 2.50, 0.00, 1800, 1600, 1500, 1.5, 40),
    "GR6": (106, 0.10, 0.00, 0.00, 3.40, 0.00, 2200, 2000, 1500, 1.5, 40),
    "GR7": (107, 1.00, 0.00, 0.00, 5.40, 0.00, 2000, 1800, 1500, 3.0, 15),
    "GR8": (108, 0.50, 1.00, 0.00, 7.30, 0.00, 1500, 1300, 1500, 4.0, 30),
    "GR9": (109, 1.00, 1.00, 0.00, 9.00, 0.00, 1800, 1600, 1500, 5.0, 40),
    "GS1": (121, 0.20, 0.00, 0.00, 0.50, 0.65, 2000, 1800, 1800, 0.9, 15),
    "GS2": (122, 0.50, 0.50, 0.00, 0.60, 1.00, 2000, 1800, 1800, 1.5, 15),
    "GS3": (123, 0.30, 0.25, 0.00, 1.45, 1.25, 1800, 1600, 1600, 1.8, 40),
    "GS4": (124, 1.90, 0.30, 0.10, 3.40, 7.10, 1800, 1600, 1600, 2.1, 40),
    "SH1": (141, 0.25, 0.25, 0.00, 0.15, 1.30, 2000, 1800, 1600, 1.0, 15),
    "SH2": (142, 1.35, 2.40, 0.75, 0.00, 3.85, 2000, 1500, 1600, 1.0, 15),
    "SH3": (143, 0.45, 3.00, 0.00, 0.00, 6.20, 1600, 1500, 1400, 2.4, 40),
    "SH4": (144, 0.85, 1.15, 0.20, 0.00, 2.55, 2000, 1800, 1600, 3.0, 30),
    "SH5": (145, 3.60, 2.10, 0.00, 0.00, 2.90, 750, 1500, 1600, 6.0, 15),
    "SH6": (146, 2.90, 1.45, 0.00, 0.00, 1.40, 750, 1500, 1600, 2.0, 30),
    "SH7": (147, 3.50, 5.30, 2.20, 0.00, 3.40, 750, 1500, 1600, 6.0, 15),
    "SH8": (148, 2.05, 3.40, 0.85, 0.00, 4.35, 750, 1500, 1600, 3.0, 40),
    "SH9": (149, 4.50, 2.45, 0.00, 1.55, 7.00, 750, 1800, 1500, 4.4, 40),
    "TU1": (161, 0.20, 0.90, 1.50, 0.20, 0.90, 2000, 1800, 1600, 0.6, 20),
    "TU2": (162, 0.95, 1.80, 1.25, 0.00, 0.20, 2000, 1500, 1600, 1.0, 30),
    "TU3": (163, 1.10, 0.15, 0.25, 0.65, 1.10, 1800, 1600, 1400, 1.3, 30),
    "TU4": (164, 4.50, 0.00, 0.00, 0.00, 2.00, 2300, 1500, 2000, 0.5, 12),
    "TU5": (165, 4.00, 4.00, 3.00, 0.00, 3.00, 1500, 1500, 750, 1.0, 25),
    "TL1": (181, 1.00, 2.20, 3.60, 0.00, 0.00, 2000, 1500, 1500, 0.2, 30),
    "TL2": (182, 1.40, 2.30, 2.20, 0.00, 0.00, 2000, 1500, 1500, 0.2, 25),
    "TL3": (183, 0.50, 2.20, 2.80, 0.00, 0.00, 2000, 1500, 1500, 0.3, 20),
    "TL4": (184, 0.50, 1.50, 4.20, 0.00, 0.00, 2000, 1500, 1500, 0.4, 25),
    "TL5": (185, 1.15, 2.50, 4.40, 0.00, 0.00, 2000, 1500, 1600, 0.6, 25),
    "TL6": (186, 2.40, 1.20, 1.20, 0.00, 0.00, 2000, 1500, 1500, 0.3, 25),
    "TL7": (187, 0.30, 1.40, 8.10, 0.00, 0.00, 2000, 1500, 1500, 0.4, 25),
    "TL8": (188, 5.80, 1.40, 1.10, 0.00, 0.00, 1800, 1500, 1500, 0.3, 35),
    "TL9": (189, 6.65, 3.30, 4.15, 0.00, 0.00, 1800, 1500, 1600, 0.6, 35),
    "SB1": (201, 1.50, 3.00, 11.00, 0.00, 0.00, 2000, 1500, 1500, 1.0, 25),
    "SB2": (202, 4.50, 4.25, 4.00, 0.00, 0.00, 2000, 1500, 1500, 1.0, 25),
    "SB3": (203, 5.50, 2.75, 3.00, 0.00, 0.00, 2000, 1500, 1500, 1.2, 25),
    "SB4": (204, 5.25, 3.50, 5.25, 0.00, 0.00, 2000, 1500, 1500, 2.7, 25),
}
_HEAT = {"GR6": 9000.0}
"""Low heat content where it is not 8000 Btu/lb."""
_LOADS = ("load_1h", "load_10h", "load_100h", "load_live_herbaceous", "load_live_woody")
_RATIOS = ("sav_1h", "sav_live_herbaceous", "sav_live_woody")
_DIGITS = 4
"""Decimals of loads in lb/ft2, as other programs' tables have them: 0.002 short tons/acre, where the source tells
0.05. Exact conversions move rates by up to 1 % where live fuel is about to stop burning."""


@kept(1)
def anderson_13() -> FuelTable:
    """Return the 13 fuel models (Anderson 1982), codes 1..13, names FM1..FM13, and what does not burn."""
    models = {code: UNBURNABLE for code in NOT_BURNABLE.values()}
    for code, (*loads, sav, live, depth, extinction) in _ANDERSON.items():
        models[code] = _model(loads, (sav, live, live), depth, extinction)
    return fuel_table(models, {**NOT_BURNABLE, **{f"FM{code}": code for code in _ANDERSON}})


@kept(1)
def scott_burgan_40() -> FuelTable:
    """Return the 40 fuel models (Scott and Burgan 2005), codes 101..204, names GR1..SB4, and what does not burn."""
    models = {code: UNBURNABLE for code in NOT_BURNABLE.values()}
    for name, (code, *loads, sav, herbs, woody, depth, extinction) in _SCOTT_BURGAN.items():
        pounds = [round(load * TON_PER_ACRE, _DIGITS) for load in loads]
        model = _model(pounds, (sav, herbs, woody), depth, extinction)
        models[int(code)] = replace(model, heat=_HEAT.get(name, 8000.0), dynamic=model.load_live_herbaceous > 0.0)
    return fuel_table(models, {**NOT_BURNABLE, **{name: int(row[0]) for name, row in _SCOTT_BURGAN.items()}})


def _model(pounds: Sequence[float], ratios: Sequence[float], depth: float, extinction: float) -> FuelModel:
    """Return a fuel model of loads in lb/ft2, in the order of the tables."""
    loads = [load / TON_PER_ACRE for load in pounds]
    values = dict(zip((*_LOADS, *_RATIOS), (*loads, *map(float, ratios)), strict=True))
    return FuelModel(depth=depth, extinction_moisture=float(extinction), dynamic=False, **values)
