"""Rothermel's surface fire spread model: response of a fuel bed without wind and slope, and its factors for both.

Equations: Rothermel 1972 (INT-115), as revised by Albini 1976 (INT-30) and put together by Andrews 2018
(RMRS-GTR-371). They are in the sources' units: feet, pounds, minutes, British thermal units; what leaves is metric.
Everything is batched over a leading shape, keeps the dtype, and can be differentiated.
"""

from dataclasses import dataclass, fields

import torch
from torch import Tensor

from warp_torchrl.world.behaviour.fuel_models import FOOT, Fuels

_DENSITY = 32.0
"""Of oven-dry particles [lb/ft3]."""
_MINERALS = 1.0 - 0.0555
"""Share of dry weight that is not mineral."""
_MINERAL_DAMPING = 0.174 * 0.01**-0.19
"""For an effective mineral content of 0.01."""
_USUAL_PACKING, _USUAL_SAV = 0.01, 1500.0
"""Of ground without fuel, so that what follows from them is finite."""
_KILOJOULES = 1.055056 / FOOT**2
"""kJ/m2 in a Btu/ft2."""


@dataclass(frozen=True)
class BedResponse:
    """Response of one fuel bed at one moisture; all fields of one shape."""

    rate: Tensor  # of spread without wind and slope [m/min]
    heat: Tensor  # released by a unit of area as the front passes [kJ/m2]
    wind_scale: Tensor  # the wind factor is wind_scale * (midflame wind [m/min]) ** wind_power
    wind_power: Tensor
    slope_scale: Tensor  # the slope factor is slope_scale * tan(slope) ** 2
    top_wind: Tensor  # the effective wind past which the model is not reliable [m/min]

    def at(self, row: Tensor) -> "BedResponse":
        """Return the responses at flat places, of the places' shape."""
        places = row.flatten()
        return BedResponse(
            **{each.name: getattr(self, each.name).flatten()[places].view(row.shape) for each in fields(self)}
        )


def bed_response(fuels: Fuels, moisture: Tensor) -> BedResponse:
    """Return the responses of fuel beds at a moisture; ground without fuel has a rate and a heat of 0.

    Args:
        fuels: Fuel models of leading shape [...].
        moisture: Of dead fuel of 1, 10 and 100 hours, live herbaceous and live woody fuel, [..., 5], broadcast against
            the models [% of dry weight].
    """
    water = moisture / 100.0
    load = cured_load(fuels, water[..., 3])
    water = torch.cat((water[..., :3], water[..., :1], water[..., 3:]), dim=-1)
    area = fuels.sav * load / _DENSITY
    dead_area, live_area = area[..., :4].sum(-1), area[..., 4:].sum(-1)
    share = torch.cat(
        (area[..., :4] / _positive(dead_area)[..., None], area[..., 4:] / _positive(live_area)[..., None]), -1
    )
    dead_share = dead_area / _positive(dead_area + live_area)
    live_share = live_area / _positive(dead_area + live_area)
    sav = _positive(dead_share * _dead(share * fuels.sav) + live_share * _live(share * fuels.sav), _USUAL_SAV)
    packing = _positive(load.sum(-1) / (_DENSITY * _positive(fuels.depth)), _USUAL_PACKING)
    relative = packing / (3.348 * sav**-0.8189)

    reaction = reaction_velocity(sav, relative) * _burnable_heat(fuels, load, share, water)
    flux = torch.exp((0.792 + 0.681 * sav.sqrt()) * (packing + 0.1)) / (192.0 + 0.2595 * sav)
    warming = share * torch.exp(-138.0 / fuels.sav.clamp(min=1.0)) * (250.0 + 1116.0 * water)
    sink = packing * _DENSITY * (dead_share * _dead(warming) + live_share * _live(warming))
    power = 0.02526 * sav**0.54
    damping = relative ** (-0.715 * torch.exp(-3.59e-4 * sav))
    return BedResponse(
        rate=reaction * flux / _positive(sink) * FOOT,
        heat=reaction * 384.0 / sav * _KILOJOULES,  # residence time of the front: Anderson 1969
        wind_scale=7.47 * torch.exp(-0.133 * sav**0.55) * damping * FOOT**-power,
        wind_power=power,
        slope_scale=5.275 * packing**-0.3,
        top_wind=0.9 * reaction * FOOT,
    )


def cured_load(fuels: Fuels, herbaceous_moisture: Tensor) -> Tensor:
    """Return the load of the six classes after curing, [..., 6] [lb/ft2].

    In dynamic models the share of grass and herbs that is dead rises from 0 at 120 % moisture to 1 at 30 % (Burgan
    1979; Scott and Burgan 2005).

    Args:
        fuels: Fuel models of leading shape [...].
        herbaceous_moisture: [...], a share of dry weight.
    """
    cured = ((1.2 - herbaceous_moisture) / 0.9).clamp(0.0, 1.0) * fuels.dynamic
    load = fuels.load.expand(*cured.shape, 5)
    herbs = load[..., 3]
    return torch.cat((load[..., :3], torch.stack((herbs * cured, herbs * (1.0 - cured), load[..., 4]), -1)), -1)


def reaction_velocity(sav: Tensor, relative: Tensor) -> Tensor:
    """Return the optimum reaction velocity [1/min] (Rothermel 1972 eqs. 36 and 38; Albini 1976 for the exponent).

    Args:
        sav: Characteristic surface-area-to-volume ratio of the bed [1/ft].
        relative: Packing ratio over the optimum one.
    """
    power = 133.0 * sav**-0.7913
    most = sav**1.5 / (495.0 + 0.0594 * sav**1.5)
    return most * relative**power * torch.exp(power * (1.0 - relative))


def moisture_damping(moisture: Tensor, extinction: Tensor) -> Tensor:
    """Return the factor of moisture on the reaction intensity, 1 to 0 (Rothermel 1972 eq. 29)."""
    ratio = (moisture / _positive(extinction)).clamp(max=1.0)
    share = 1.0 - 2.59 * ratio + 5.11 * ratio**2 - 3.52 * ratio**3
    return torch.where(ratio < 1.0, share.clamp(min=0.0), 0.0)  # at 1 the rounded sum is not quite 0


def live_extinction(fuels: Fuels, load: Tensor, water: Tensor) -> Tensor:
    """Return the moisture of extinction of live fuel, [...] (Rothermel 1972 eq. 88; Albini 1976, appendix III).

    Args:
        fuels: Fuel models of leading shape [...].
        load: Of the six classes [..., 6] [lb/ft2].
        water: Their moisture, shares of dry weight [..., 6].
    """
    ratio = fuels.sav.clamp(min=1.0)
    fine_dead = load[..., :4] * torch.exp(-138.0 / ratio[..., :4])
    fine_live = (load[..., 4:] * torch.exp(-500.0 / ratio[..., 4:])).sum(-1)
    dead = fine_dead.sum(-1)
    moisture = (fine_dead * water[..., :4]).sum(-1) / _positive(dead)
    drying = 1.0 - moisture / _positive(fuels.extinction)
    told = 2.9 * dead / _positive(fine_live) * drying - 0.226
    return torch.where(fine_live > 0.0, torch.maximum(told, fuels.extinction), fuels.extinction)


def _burnable_heat(fuels: Fuels, load: Tensor, share: Tensor, water: Tensor) -> Tensor:
    """Return the heat that dead and live fuel would release, damped by moisture and minerals, [...] [Btu/ft2]."""
    weight = (fuels.same_size * share[..., None, :]).sum(-1)
    net = weight * load * _MINERALS
    dead = _dead(net) * moisture_damping(_dead(share * water), fuels.extinction)
    live = _live(net) * moisture_damping(_live(share * water), live_extinction(fuels, load, water))
    return (dead + live) * fuels.heat * _MINERAL_DAMPING


def _dead(classes: Tensor) -> Tensor:
    return classes[..., :4].sum(-1)


def _live(classes: Tensor) -> Tensor:
    return classes[..., 4:].sum(-1)


def _positive(value: Tensor, otherwise: float = 1e-3) -> Tensor:
    """Return a divisor that is never 0; where it was 0 the numerator is 0 too."""
    return torch.where(value > 0.0, value, otherwise)
