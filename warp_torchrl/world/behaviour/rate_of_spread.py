"""Rates of spread for users: one call for all fuel models."""

from collections.abc import Mapping
from dataclasses import fields
from typing import Any, Literal, get_args

import numpy as np
import torch
from torch import Tensor

from warp_torchrl.validation import did_you_mean
from warp_torchrl.world.behaviour.crown import (
    FOLIAR_MOISTURE,
    KILOJOULES_PER_KG,
    Canopy,
    CrownModel,
    Surroundings,
    with_crowns,
)
from warp_torchrl.world.behaviour.fuel_codes import read_fuel, read_model
from warp_torchrl.world.behaviour.fuel_models import FuelTable
from warp_torchrl.world.behaviour.rothermel import bed_response
from warp_torchrl.world.behaviour.spread import Spread
from warp_torchrl.world.behaviour.surface import head_of_fire
from warp_torchrl.world.behaviour.wind_adjustment import TEN_METRES, wind_adjustment_factor

WindHeight = Literal["10m", "20ft", "midflame"]
"""Where the wind is measured."""

_DEAD = {"dead_1h": (1.0, 300.0), "dead_10h": (1.0, 300.0), "dead_100h": (1.0, 300.0)}
_LIVE = {"live_herbaceous": (1.0, 1000.0), "live_woody": (1.0, 1000.0)}
_CODES = {"ffmc": (0.0, 101.0), "bui": (0.0, 10000.0)}
_CROWNS = ("base_height", "bulk_density")
_CANOPY = {
    "cover": (0.0, 100.0),
    "height": (0.0, 150.0),
    "crown_ratio": (0.01, 1.0),
    "base_height": (0.0, 150.0),
    "bulk_density": (0.0, 2.0),
    "foliar_moisture": (20.0, 400.0),
}
_LATER = {"dead_10h": 1.0, "dead_100h": 2.0}
"""How much moister thicker dead fuel is where nothing is said [%]: as in the moisture scenarios of Scott and Burgan
(2005), table 3."""
_NO_LIVE = 100.0  # per cent; of live fuel that no model in use has, so that it does nothing


def rate_of_spread(
    fuel: object,
    model: str | Mapping[Any, Any] = "fbfm40",
    wind: tuple[object, object] = (0.0, 0.0),
    slope: object = 0.0,
    aspect: object = 0.0,
    *,
    moisture: Mapping[str, object],
    wind_height: WindHeight = "10m",
    canopy: Mapping[str, object] | None = None,
    crown: CrownModel = "cruz",
) -> Spread:
    """Return the behaviour of the head of a surface fire, or of a crown fire where the canopy tells of its crowns.

    Numbers, arrays and tensors are broadcast to one shape; the fields are float32 tensors of it. Gradients flow back
    to tensors of wind, slope and moisture. Rates are steady and along the ground, not the map. See
    ``behaviour.rothermel``, ``behaviour.surface`` and ``behaviour.crown`` for the equations and their sources,
    ``behaviour.fbp`` for the Canadian ones.

    Args:
        fuel: Codes of fuel models, or their names ("GR2", "FM4", "C-2").
        model: "fbfm13" (Anderson 1982), "fbfm40" (Scott and Burgan 2005), "fbp" (Forestry Canada 1992), or own fuel
            models by code, each a ``FuelModel`` or a mapping of its fields.
        wind: Speed [m/s], and where the wind comes from [degrees clockwise from grid north].
        slope: Steepness [degrees], below 90.
        aspect: Where downhill is [degrees clockwise from grid north].
        moisture: "dead_1h", "dead_10h", "dead_100h", "live_herbaceous", "live_woody" [% of dry weight]. Without
            dead_10h it is dead_1h + 1, without dead_100h dead_1h + 2. Live moistures may be left out where no fuel has
            such a load. For "fbp": "ffmc" and "bui".
        wind_height: Where the wind is measured: "10m" or "20ft" above the vegetation in the open, or "midflame". To
            midflame height the wind is reduced by the fuel's depth, or by the canopy. "fbp" needs "10m" or "20ft".
        canopy: "cover", ground under crowns [%], and "height" of trees [m], by which the wind is reduced; with them
            "crown_ratio", length of crowns over the height of trees, in (0, 1], 1 if not given, as FlamMap and FARSITE
            do. Crowns burn if "base_height" [m] and "bulk_density" [kg/m3] are there too; "foliar_moisture", water in
            needles, is 100 % of dry weight if not given. None is open ground.
        crown: Rule of the rate of crown fire: "cruz" or "rothermel", see ``behaviour.crown``; "none" has surface fire
            alone.

    Raises:
        ValueError: If a fuel is not known, a value lies out of its range or is missing, or shapes do not broadcast.
    """
    if wind_height not in get_args(WindHeight):
        raise ValueError(f"wind_height must be {', '.join(get_args(WindHeight))}, got {wind_height!r}")
    if not isinstance(wind, tuple | list) or len(wind) != 2:
        raise ValueError(f"wind must be a speed and a bearing, got {wind!r}")
    if not isinstance(moisture, Mapping):
        raise ValueError(f"moisture must be a mapping of per cent by name, got {moisture!r}")
    if crown not in get_args(CrownModel):
        raise ValueError(f"crown must be {', '.join(get_args(CrownModel))}, got {crown!r}")
    table = read_model(model)
    codes = read_fuel(fuel, table, model)
    trees = _canopy(canopy)
    place = _device(codes, *wind, slope, aspect, *moisture.values(), *trees.values())
    ground = {
        "wind speed": _numbers("wind speed", wind[0], 0.0, 150.0),
        "wind bearing": _numbers("wind bearing", wind[1], -720.0, 720.0),
        "slope": _numbers("slope", slope, 0.0, 89.0),
        "aspect": _numbers("aspect", aspect, -720.0, 720.0),
    }
    water = _moisture(moisture, {**_DEAD, **_LIVE} if table else _CODES)
    named = {f"canopy.{name}": each for name, each in trees.items()}
    named |= {f"moisture.{name}": each for name, each in water.items()}
    shape = _shape({"fuel": codes, **ground, **named})
    codes = codes.to(place)
    speed, bearing, steepness, downhill = (each.to(place) for each in ground.values())
    water = {name: each.to(place) for name, each in water.items()}
    trees = {name: each.to(place) for name, each in trees.items()}
    if table is None:
        spread = _canadian(codes, speed, bearing, steepness, downhill, water, wind_height, trees)
    else:
        table = table.to(device=place)
        row = table.index(codes)
        levels = _levels(table, row, water)
        midflame = speed * _to_midflame(table, row, wind_height, trees)
        spread = _rothermel(table, row, midflame, bearing, steepness, downhill, levels)
        if crown != "none" and "bulk_density" in trees:
            speed = speed * TEN_METRES if wind_height == "20ft" else speed
            air = Surroundings(speed, bearing, steepness, downhill, levels)
            heat = table.fuels.heat[row] * KILOJOULES_PER_KG
            foliar = trees.get("foliar_moisture", FOLIAR_MOISTURE)
            crowns = Canopy(**{each.name: trees[each.name] for each in fields(Canopy)})
            spread = with_crowns(spread, crowns, air, heat=heat, foliar_moisture=foliar, model=crown)
    return Spread(**{each.name: getattr(spread, each.name).float().expand(shape) for each in fields(Spread)})


def _levels(table: FuelTable, row: Tensor, water: dict[str, Tensor]) -> Tensor:
    """Return the moistures of the five classes of fuel, [..., 5] [%]; those that are left out are filled."""
    used = table.fuels.load[row.unique()].sum(0) > 0.0
    for column, name in ((3, "live_herbaceous"), (4, "live_woody")):
        if name not in water and bool(used[column]):
            raise ValueError(f"moisture must have {name} where fuels have such a load, got {', '.join(water)}")
    if "dead_1h" not in water:
        raise ValueError(f"moisture must have dead_1h, got {', '.join(water) or 'nothing'}")
    filled = {name: water["dead_1h"] + more for name, more in _LATER.items()}
    filled |= {name: torch.full((), _NO_LIVE, device=row.device) for name in _LIVE} | water
    ordered = torch.broadcast_tensors(*(filled[name] for name in (*_DEAD, *_LIVE)))
    return torch.stack(ordered, dim=-1)


def _rothermel(
    table: FuelTable,
    row: Tensor,
    speed: Tensor,
    bearing: Tensor,
    slope: Tensor,
    aspect: Tensor,
    levels: Tensor,
) -> Spread:
    beds = bed_response(table.fuels, levels).at(row) if levels.dim() == 1 else bed_response(table.fuels.at(row), levels)
    return head_of_fire(beds, speed * 60.0, bearing, slope, aspect)


def _canadian(
    codes: Tensor,
    speed: Tensor,
    bearing: Tensor,
    slope: Tensor,
    aspect: Tensor,
    water: dict[str, Tensor],
    wind_height: str,
    canopy: dict[str, Tensor],
) -> Spread:
    from warp_torchrl.world.behaviour.fbp import fbp_spread

    if wind_height == "midflame":
        raise ValueError("wind_height must be 10m or 20ft for fbp, whose wind is that at 10 m, got midflame")
    if canopy:
        raise ValueError("canopy must be left out for fbp, whose fuel types have their canopy, got one")
    if missing := [name for name in _CODES if name not in water]:
        raise ValueError(f"moisture must have {' and '.join(missing)} for fbp, got {', '.join(water) or 'nothing'}")
    if wind_height == "20ft":
        speed = speed * TEN_METRES
    return fbp_spread(
        codes, wind_speed=speed, wind_bearing=bearing, slope=slope, aspect=aspect, ffmc=water["ffmc"], bui=water["bui"]
    )


def _to_midflame(table: FuelTable, row: Tensor, wind_height: str, canopy: dict[str, Tensor]) -> Tensor:
    """Return the midflame wind over the wind at the height where it is measured."""
    if wind_height == "midflame":
        if canopy:
            raise ValueError("canopy must be left out where wind_height is midflame, got one")
        return torch.ones((), device=row.device)
    zero = torch.zeros((), device=row.device)
    cover, height = canopy.get("cover", zero), canopy.get("height", zero)
    factor = wind_adjustment_factor(table.fuels.depth[row], cover, height, canopy.get("crown_ratio", zero + 1.0))
    return factor / TEN_METRES if wind_height == "10m" else factor


def _canopy(given: Mapping[str, object] | None) -> dict[str, Tensor]:
    """Return what is given of a canopy."""
    if given is None:
        return {}
    if not isinstance(given, Mapping):
        raise ValueError(f"canopy must be a mapping of numbers by name, got {given!r}")
    for name in given:
        if name not in _CANOPY:
            raise ValueError(
                f"canopy must have some of {', '.join(_CANOPY)}, got {name!r}{did_you_mean(name, _CANOPY)}"
            )
    for needed in (("cover", "height"), _CROWNS if any(name in given for name in _CROWNS) else ()):
        if missing := [name for name in needed if name not in given]:
            raise ValueError(f"canopy must have {' and '.join(missing)}, got {', '.join(given) or 'nothing'}")
    return {name: _numbers(f"canopy.{name}", value, *_CANOPY[name]) for name, value in given.items()}


def _moisture(given: Mapping[str, object], ranges: Mapping[str, tuple[float, float]]) -> dict[str, Tensor]:
    for name in given:
        if name not in ranges:
            hint = did_you_mean(name, ranges)
            raise ValueError(f"moisture must have some of {', '.join(ranges)} for this model, got {name!r}{hint}")
    return {name: _numbers(f"moisture.{name}", value, *ranges[name]) for name, value in given.items()}


def _numbers(name: str, value: object, low: float, high: float) -> Tensor:
    """Return numbers as a float32 tensor; one on which a gradient may flow back stays on its graph."""
    if isinstance(value, Tensor):
        numbers = value.float()
    else:
        given = np.asarray(value)
        if given.dtype.kind not in "iuf":
            raise ValueError(f"{name} must be numbers, got {value!r}")
        numbers = torch.tensor(given.astype(np.float32))
    is_fit = (numbers >= low) & (numbers <= high)  # NaN is in no range
    if not bool(is_fit.all()):
        first = numbers.detach()[~is_fit].flatten()[0].item()
        raise ValueError(f"{name} must be in [{low:g}, {high:g}], got {first:g}")
    return numbers


def _shape(values: Mapping[str, Tensor]) -> torch.Size:
    shapes = {name: tuple(each.shape) for name, each in values.items() if each.dim()}
    try:
        return torch.broadcast_shapes(*shapes.values())
    except RuntimeError as error:
        told = ", ".join(f"{name} {shape}" for name, shape in shapes.items())
        raise ValueError(f"shapes must broadcast to one, got {told}") from error


def _device(*values: object) -> torch.device:
    """Return the device of the first tensor that is not on the CPU; the CPU's if there is none."""
    places = [each.device for each in values if isinstance(each, Tensor) and each.device.type != "cpu"]
    return places[0] if places else torch.device("cpu")
