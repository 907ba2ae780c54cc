"""Fuel models: the parameters of a fuel bed, and tables of them as tensors.

Units are those in which fuel models are published, in standard tables and in files of custom models alike: short tons
per acre, feet, square feet of surface per cubic foot of fuel, per cent, British thermal units per pound.
"""

from collections.abc import Mapping
from dataclasses import dataclass, fields
from typing import Any

import torch
from torch import Tensor

from warp_torchrl.validation import check_fields, did_you_mean

FOOT = 0.3048
"""Metres in a foot."""
TON_PER_ACRE = 2000.0 / 43560.0
"""Pounds per square foot in a short ton per acre."""
SAV_10H, SAV_100H = 109.0, 30.0
"""Surface-area-to-volume ratio of dead fuel of 10 and 100 hours in every fuel model (Albini 1976) [1/ft]."""
_SIZES = (1200.0, 192.0, 96.0, 48.0, 16.0)
"""Lower bounds of the size classes by which loads are weighted (Albini 1976, p. 20) [1/ft]."""
_METRIC = {"load": 0.446090, "sav": 30.48, "depth": 1 / 30.48, "heat": 0.429923}
"""Factors from tonnes per hectare, 1/cm, cm and kJ/kg, the metric units of custom fuel files, to those here."""


@dataclass(frozen=True, kw_only=True)
class FuelModel:
    """One fuel model of Rothermel's spread model.

    Attributes:
        depth: Of the fuel bed [ft].
        extinction_moisture: Moisture of dead fuel at which fire stops spreading [%].
        load_1h: Dead fuel of less than 6 mm [short tons/acre].
        load_10h: Dead fuel of 6 to 25 mm [short tons/acre].
        load_100h: Dead fuel of 25 to 76 mm [short tons/acre].
        load_live_herbaceous: Grass and herbs [short tons/acre].
        load_live_woody: Shrubs' leaves and twigs [short tons/acre].
        sav_1h: Surface-area-to-volume ratio of dead fuel of less than 6 mm [1/ft].
        sav_live_herbaceous: The same of grass and herbs, living or cured [1/ft].
        sav_live_woody: The same of shrubs [1/ft].
        heat: Low heat content [Btu/lb].
        dynamic: Whether grass and herbs cure: their load becomes dead as their moisture falls from 120 to 30 %.

    Raises:
        ValueError: If a value lies out of its range, or a model with fuel has no depth or no extinction moisture.
    """

    depth: float
    extinction_moisture: float
    load_1h: float = 0.0
    load_10h: float = 0.0
    load_100h: float = 0.0
    load_live_herbaceous: float = 0.0
    load_live_woody: float = 0.0
    sav_1h: float = 2000.0
    sav_live_herbaceous: float = 1500.0
    sav_live_woody: float = 1500.0
    heat: float = 8000.0
    dynamic: bool = False

    def __post_init__(self) -> None:
        loads = dict.fromkeys([each.name for each in fields(self) if each.name.startswith("load")], (0.0, 200.0))
        ratios = dict.fromkeys([each.name for each in fields(self) if each.name.startswith("sav")], (0.0, 6000.0))
        check_fields(self, **loads, **ratios, depth=(0.0, 30.0), extinction_moisture=(0.0, 100.0), heat=(0.0, 15000.0))
        if any(self.loads) and not (self.depth > 0.0 and self.extinction_moisture > 0.0):
            given = f"depth {self.depth:g}, extinction_moisture {self.extinction_moisture:g}"
            raise ValueError(f"depth and extinction_moisture must be above 0 where there is fuel, got {given}")

    @classmethod
    def of(cls, given: Mapping[str, Any], name: str = "fuel model") -> "FuelModel":
        """Return the fuel model of a mapping, as a yaml file gives it.

        Args:
            given: The attributes by name. ``units: metric`` says that they are in tonnes/ha, 1/cm, cm and kJ/kg.
            name: What messages call it.

        Raises:
            ValueError: If a name is not known, an attribute without a default is not there, or a value is refused.
        """
        known = {each.name for each in fields(cls)}
        values = dict(given)
        units = values.pop("units", "english")
        for key in values:
            if key not in known:
                raise ValueError(f"{name} must have fields of FuelModel, got {key!r}{did_you_mean(key, sorted(known))}")
        if missing := [key for key in ("depth", "extinction_moisture") if key not in values]:
            raise ValueError(f"{name} must have {' and '.join(missing)}, got {', '.join(values) or 'nothing'}")
        if units not in ("english", "metric"):
            raise ValueError(f"units of {name} must be english or metric, got {units!r}")
        return cls(**(_from_metric(values) if units == "metric" else values))

    @property
    def loads(self) -> tuple[float, ...]:
        """Loads of dead fuel of 1, 10 and 100 hours, of grass and herbs, and of shrubs [short tons/acre]."""
        return self.load_1h, self.load_10h, self.load_100h, self.load_live_herbaceous, self.load_live_woody

    @property
    def ratios(self) -> tuple[float, ...]:
        """Surface-area-to-volume ratios in the same order [1/ft]."""
        return self.sav_1h, SAV_10H, SAV_100H, self.sav_live_herbaceous, self.sav_live_woody


@dataclass(frozen=True)
class Fuels:
    """Fuel models as tensors of any leading shape, all of one floating dtype.

    The six classes of fuel are dead of 1, 10 and 100 hours, cured grass, living grass, and shrubs.
    """

    load: Tensor  # [..., 5] before curing, without the class of cured grass [lb/ft2]
    sav: Tensor  # [..., 6] surface-area-to-volume ratio [1/ft]
    same_size: Tensor  # [..., 6, 6] 1 where two classes share their size, both dead or both alive
    depth: Tensor  # [...] of the fuel bed [ft]
    extinction: Tensor  # [...] moisture of extinction of dead fuel, a share of dry weight
    heat: Tensor  # [...] low heat content [Btu/lb]
    dynamic: Tensor  # [...] 1 where grass cures, else 0

    def at(self, index: Tensor) -> "Fuels":
        """Return the models at places of the first dimension; the index's shape takes that dimension's place."""
        return Fuels(**{each.name: getattr(self, each.name)[index] for each in fields(self)})

    def to(self, *, device: torch.device | None = None, dtype: torch.dtype | None = None) -> "Fuels":
        """Return the models on another device, or in another precision."""
        return Fuels(**{each.name: getattr(self, each.name).to(device=device, dtype=dtype) for each in fields(self)})


@dataclass(frozen=True)
class FuelTable:
    """Fuel models by code; the last row is no fuel."""

    fuels: Fuels  # of leading shape [F + 1]
    codes: Tensor  # int64 [F], rising
    names: Mapping[str, int]  # code of each model by its name in capitals

    def index(self, codes: Tensor) -> Tensor:
        """Return each code's row, int64 of the codes' shape; a code that is not known is no fuel."""
        wanted = codes.long()
        place = torch.searchsorted(self.codes, wanted).clamp(max=len(self.codes) - 1)
        return torch.where(self.codes[place] == wanted, place, len(self.codes))

    def to(self, *, device: torch.device | None = None, dtype: torch.dtype | None = None) -> "FuelTable":
        """Return the table on another device; the precision is that of its fuels."""
        return FuelTable(self.fuels.to(device=device, dtype=dtype), self.codes.to(device), self.names)


def _from_metric(given: Mapping[str, Any]) -> dict[str, Any]:
    """Return a model's given values in the units of its class; what is no number is left to be refused."""
    return {
        key: value * _METRIC.get(key.partition("_")[0], 1.0) if type(value) in (int, float) else value
        for key, value in given.items()
    }


UNBURNABLE = FuelModel(depth=0.0, extinction_moisture=0.0)
"""Ground that does not burn."""


def fuel_table(models: Mapping[int, FuelModel], names: Mapping[str, int] | None = None) -> FuelTable:
    """Return fuel models by code as a table of float32 tensors.

    Raises:
        ValueError: If there is no model.
    """
    if not models:
        raise ValueError("model must have at least one fuel model, got none")
    codes = sorted(models)
    rows = [*(models[code] for code in codes), UNBURNABLE]
    sav = torch.tensor([(*row.ratios[:4], *row.ratios[3:]) for row in rows])
    size = torch.bucketize(sav, torch.tensor(_SIZES[::-1]), right=True)
    alive = torch.tensor([False] * 4 + [True] * 2)
    same = (size[:, :, None] == size[:, None, :]) & (alive[:, None] == alive)
    fuels = Fuels(
        load=torch.tensor([row.loads for row in rows]) * TON_PER_ACRE,
        sav=sav,
        same_size=same.float(),
        depth=torch.tensor([row.depth for row in rows]),
        extinction=torch.tensor([row.extinction_moisture / 100.0 for row in rows]),
        heat=torch.tensor([row.heat for row in rows]),
        dynamic=torch.tensor([float(row.dynamic) for row in rows]),
    )
    return FuelTable(fuels, torch.tensor(codes), {name.upper(): code for name, code in (names or {}).items()})
