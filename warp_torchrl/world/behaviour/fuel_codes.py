"""Fuel as users give it: codes of a map or names, of a standard set, the Canadian system or the user's own set."""

from collections.abc import Mapping
from typing import Any

import numpy as np
import torch
from torch import Tensor

from warp_torchrl.validation import did_you_mean
from warp_torchrl.world.behaviour.fuel_models import FuelModel, FuelTable, fuel_table
from warp_torchrl.world.behaviour.standard_fuels import anderson_13, scott_burgan_40

FBP_NAMES: Mapping[str, int] = {
    **{f"C-{number}": number for number in range(1, 8)},
    **{f"D-{number}": 10 + number for number in (1, 2)},
    **{f"S-{number}": 20 + number for number in (1, 2, 3)},
    **{"O-1A": 31, "O-1B": 32, "M-1": 40, "M-2": 50, "M-3": 70, "M-4": 80},
}
"""Codes of the Canadian fuel types by name."""
FBP_CODES = torch.tensor(sorted({*FBP_NAMES.values(), 0, 13, 60, 90, 99, *range(100, 107), *range(400, 1000)}))
"""Codes of the Canadian fuel types and of what is no fuel there."""
_SETS = {"fbfm13": anderson_13, "fbfm40": scott_burgan_40}
_SHOWN = 5  # unknown codes that a message names


def read_model(model: str | Mapping[Any, Any]) -> FuelTable | None:
    """Return the table of a set of fuel models, None for the Canadian system.

    Args:
        model: "fbfm13", "fbfm40", "fbp", or fuel models by code, each a ``FuelModel`` or a mapping of its fields.

    Raises:
        ValueError: If it is none of these, or a fuel model is refused.
    """
    if isinstance(model, Mapping):
        return fuel_table({_code(code): _own_model(code, given) for code, given in model.items()})
    if model == "fbp":
        return None
    if not isinstance(model, str) or model not in _SETS:
        hint = did_you_mean(model, (*_SETS, "fbp"))
        raise ValueError(f"model must be fbfm13, fbfm40, fbp or fuel models by code, got {model!r}{hint}")
    return _SETS[model]()


def read_fuel(fuel: object, table: FuelTable | None, model: object) -> Tensor:
    """Return fuel codes, int64 of the fuel's shape.

    Args:
        fuel: Codes or names: one, a sequence, an array or a tensor.
        table: Fuel models, None for the Canadian system.
        model: What messages call them.

    Raises:
        ValueError: If a name or a code is not known; it names up to five.
    """
    known, names = (FBP_CODES, FBP_NAMES) if table is None else (table.codes, table.names)
    called = model if isinstance(model, str) else "the given fuel models"
    if not isinstance(fuel, Tensor):
        given = np.asarray(fuel)
        if given.dtype.kind in "US":
            return _of_names(given, names, called)
        if given.dtype.kind not in "iuf":
            raise ValueError(f"fuel must be codes or names of fuels, got {fuel!r}")
        fuel = torch.from_numpy(given.astype(np.float64))
    codes = fuel.detach()
    is_known = torch.isin(codes, known.to(codes.device, codes.dtype))
    if not bool(is_known.all()):
        unknown = codes[~is_known].unique().tolist()
        listed = ", ".join(f"{code:g}" for code in unknown[:_SHOWN]) + (", ..." if len(unknown) > _SHOWN else "")
        raise ValueError(f"fuel must be codes of {called}, got {listed}")
    return codes.long()


def _of_names(given: np.ndarray[Any, Any], names: Mapping[str, int], called: str) -> Tensor:
    distinct, place = np.unique(given, return_inverse=True)
    for name in distinct.tolist():
        if str(name).upper() not in names:
            raise ValueError(f"fuel must be names of {called}, got {name!r}{did_you_mean(name, names)}")
    codes = np.array([names[str(name).upper()] for name in distinct.tolist()], dtype=np.int64)
    return torch.tensor(codes[place]).view(given.shape)


def _own_model(code: object, given: object) -> FuelModel:
    if isinstance(given, FuelModel):
        return given
    if isinstance(given, Mapping):
        return FuelModel.of(given, f"fuel model {code}")
    raise ValueError(f"fuel model {code} must be a FuelModel or a mapping of its fields, got {given!r}")


def _code(code: object) -> int:
    if isinstance(code, bool) or not str(code).lstrip("-").isdigit():
        raise ValueError(f"model must have whole numbers as codes of fuel models, got {code!r}")
    return int(str(code))
