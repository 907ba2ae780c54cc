"""The fuel of landscapes, and the rates at which fire spreads in it."""

from collections.abc import Mapping
from dataclasses import dataclass, replace
from functools import cached_property
from typing import Any, get_args

import torch
from torch import Tensor

from warp_torchrl.world.air.wind import Wind
from warp_torchrl.world.arrays.listing import filled
from warp_torchrl.world.arrays.random import world_key
from warp_torchrl.world.behaviour.acceleration import OPEN, mean_share, slowed
from warp_torchrl.world.behaviour.crown import (
    FOLIAR_MOISTURE,
    KILOJOULES_PER_KG,
    CrownModel,
    Surroundings,
    with_crowns,
)
from warp_torchrl.world.behaviour.fbp import FOLIAR_MOISTURE as FBP_FOLIAR_MOISTURE
from warp_torchrl.world.behaviour.fbp import fbp_spread
from warp_torchrl.world.behaviour.fbp_fuels import CURING
from warp_torchrl.world.behaviour.fuel_codes import read_model
from warp_torchrl.world.behaviour.fuel_models import FuelTable
from warp_torchrl.world.behaviour.moistures import MOISTURES, in_force
from warp_torchrl.world.behaviour.rothermel import BedResponse, bed_response
from warp_torchrl.world.behaviour.spread import Spread
from warp_torchrl.world.behaviour.surface import head_of_fire, surface_spread
from warp_torchrl.world.law.canopy import crowns_of, lack_of_canopy, to_midflame
from warp_torchrl.world.law.listed import gradient
from warp_torchrl.world.law.mapped_fuel import check_codes
from warp_torchrl.world.state.state import Landscape
from warp_torchrl.world.terrain.source import LandscapeSource

COVER_FUEL: Mapping[str, tuple[int, int, int, int, int]] = {
    "fbfm13": (98, 8, 1, 10, 99),
    "fbfm40": (98, 161, 102, 165, 99),
    "fbp": (102, 11, 31, 2, 101),
}
"""Fuel code of lake, wetland, grassland, forest and bare ground in each model, for landscapes without fuel codes."""

_REFERENCE_WIND = 5.0  # m/s, of flammability
_SAMPLES = 4  # worlds in which the fastest fire is looked for


@dataclass(frozen=True, kw_only=True)
class FuelBed:
    """Fuels of one model, and factors on how they burn. See ``RateFire`` for the attributes."""

    model: str
    fuel_models: Mapping[int, Any]
    fuel_of_cover: tuple[int, ...]
    fuel_gain: Mapping[int, float]
    rate_gain: float
    wind_gain: float
    slope_gain: float
    crown: CrownModel = "cruz"
    foliar_moisture: float | None = None
    curing: float = CURING
    green: bool = False
    percent_conifer: float = 50.0
    percent_dead_fir: float = 35.0
    grass_load: float = 0.35
    by_cover: bool = False  # the codes of landscapes are no fuels

    def __post_init__(self) -> None:
        if self.crown not in get_args(CrownModel):
            raise ValueError(f"crown must be {', '.join(get_args(CrownModel))}, got {self.crown}")
        if self.model not in COVER_FUEL:
            raise ValueError(f"model must be one of {', '.join(COVER_FUEL)}, got {self.model}")
        _ = self.table
        for code, gain in self.fuel_gain.items():
            if not (str(code).isdigit() and 0.0 <= gain <= 100.0):
                raise ValueError(f"fuel_gain must map fuel codes to factors in [0, 100], got {code}: {gain}")

    @cached_property
    def table(self) -> FuelTable | None:
        """Return the fuel models by code; None for the Canadian system, which has equations for each."""
        return read_model(dict(self.fuel_models) or self.model)

    def check(self, landscape: LandscapeSource) -> None:
        """Refuse landscapes whose fuel codes are of another model.

        Raises:
            ValueError: If their ``table`` is another of ``COVER_FUEL``, or codes are not those of the model.
        """
        table = getattr(landscape, "table", None)
        if isinstance(table, str) and table in COVER_FUEL and table != self.model and not self.fuel_models:
            raise ValueError(f"fire.model must be that of landscape.table, {table}, got {self.model}")
        if not self.by_cover:
            check_codes(landscape, self.table, self.model, bool(self.fuel_models))

    def fuel(self, landscape: Landscape) -> Tensor:
        """Return the fuel codes of landscapes, int16 [B, H, W]."""
        codes = landscape.layer("fuel")
        if codes is not None and not self.by_cover:
            return codes
        table = torch.tensor(self.fuel_of_cover, dtype=torch.int16, device=landscape.cover.device)
        return table.index_select(0, landscape.cover.flatten().to(torch.int32)).view(landscape.cover.shape)

    def spread(
        self,
        landscape: Landscape,
        wind: Tensor,
        moisture: Tensor,
        cell_size: float,
        rise: Tensor | None = None,
        young: tuple[float, float] | None = None,
        world: Tensor | None = None,
        beds: BedResponse | None = None,
    ) -> Spread:
        """Return what a fire's head does in each cell, float32 [B, H, W] each; rates on the map, not along the ground.

        Args:
            landscape: The landscapes.
            wind: (u east, v north) of the air's motion at 10 m in the open, float32 [B, 2, 1, 1] or [B, 2, H, W] [m/s].
            moisture: In the order of ``MOISTURES``, float32 [B, 7], or by cell [B, H, W, 7].
            cell_size: Side of a cell [m].
            rise: How steeply the ground rises, see ``gradient``; None makes it of the landscapes' elevation.
            young: Minutes since ignition over which the spread is the mean of a fire that accelerates; None: it is
                steady.
            world: Of which world each cell's moisture is, int64 [H, W], where landscapes are ``listed`` cells of all
                worlds in one row; None: of the world that the cell is in.
            beds: Of the moisture by world, see ``beds``; None makes them.
        """
        rise = gradient(landscape.elevation, landscape.cover, cell_size) if rise is None else rise
        rise = rise * self.slope_gain
        steepness = torch.rad2deg(torch.atan(rise.square().sum(1).clamp(min=1e-12).sqrt()))
        air = {
            "wind_speed": wind.square().sum(1).clamp(min=1e-12).sqrt() * self.wind_gain,
            "wind_bearing": bearing(-wind[:, 0].double(), -wind[:, 1].double()).float(),  # to the bit in any batch
            "slope": steepness,
            "aspect": bearing(-rise[:, 0], -rise[:, 1]),
        }
        fuel = self.fuel(landscape)
        if self.table is None:
            spread = self._canadian(fuel, _of_cells(moisture, world), young, **air)
        else:
            table = _on(self.table, fuel.device)
            factor = to_midflame(table.fuels.depth[table.index(fuel)], landscape)
            midflame = {**air, "wind_speed": air["wind_speed"] * factor}
            spread = self._rothermel(fuel, moisture, world, beds, **midflame)
            spread = self._with_crowns(spread, landscape, _of_cells(moisture, world), **air)
            spread = replace(spread, head=spread.head * _on_map(spread.direction, rise))
            spread = spread if young is None else slowed(spread, mean_share(OPEN, *young))
        factor = self._factor(fuel)
        return replace(
            spread,
            head=spread.head * factor,
            intensity=spread.intensity * factor,
            flame_length=spread.flame_length * factor.pow(0.46),
        )

    def _canadian(
        self,
        fuel: Tensor,
        moisture: Tensor,
        young: tuple[float, float] | None = None,
        *,
        wind_speed: Tensor,
        wind_bearing: Tensor,
        slope: Tensor,
        aspect: Tensor,
    ) -> Spread:
        codes = dict(zip(MOISTURES, moisture.unbind(-1), strict=True))
        return fbp_spread(
            fuel,
            wind_speed=wind_speed,
            wind_bearing=wind_bearing,
            slope=slope,
            aspect=aspect,
            ffmc=codes["ffmc"],
            bui=codes["bui"],
            curing=self.curing,
            percent_conifer=self.percent_conifer,
            percent_dead_fir=self.percent_dead_fir,
            grass_load=self.grass_load,
            green=self.green,
            foliar_moisture=FBP_FOLIAR_MOISTURE if self.foliar_moisture is None else self.foliar_moisture,
            young=young,
        )

    def _rothermel(
        self,
        fuel: Tensor,
        moisture: Tensor,
        world: Tensor | None = None,
        beds: BedResponse | None = None,
        *,
        wind_speed: Tensor,
        **air: Tensor,
    ) -> Spread:
        table = _on(self.table, fuel.device)
        if moisture.dim() == 4:
            return surface_spread(table, table.index(fuel), wind_speed=wind_speed, **air, moisture=moisture[..., :5])
        beds = self.beds(moisture) if beds is None else beds
        world = torch.arange(len(moisture), device=fuel.device)[:, None, None] if world is None else world
        row = table.index(fuel) + _models(table) * world
        return head_of_fire(beds.at(row), wind_speed * 60.0, **air)

    def beds(self, moisture: Tensor) -> BedResponse:
        """Return the response of each of Rothermel's fuel models in each world, float32 [B, F] each.

        F fills vectors, see ``arrays.listing``: a world alone has the numbers of one among others.

        Args:
            moisture: In the order of ``MOISTURES``, float32 [B, 7].
        """
        table = _on(self.table, moisture.device)
        models = torch.arange(_models(table), device=moisture.device).clamp(max=len(table.fuels.depth) - 1)
        return bed_response(table.fuels.at(models), moisture[:, None, :5])

    def runs_in_crowns(self, landscape: Landscape) -> bool:
        """Return whether the law burns crowns, and landscapes know theirs; Canadian rates have crown fire in them."""
        return self.table is not None and self.crown != "none" and crowns_of(landscape) is not None

    def lack_of_canopy(self, landscape: Landscape) -> str | None:
        """Return in a line what the law cannot do for lack of a canopy; None where nothing is missing."""
        return None if self.table is None else lack_of_canopy(landscape)

    def _with_crowns(self, surface: Spread, landscape: Landscape, moisture: Tensor, **air: Tensor) -> Spread:
        """Return the spread with crown fire where landscapes know their crowns, else the surface fire.

        Gains act on the intensity of the surface fire that lights crowns, and later on the rate of both.
        """
        canopy = crowns_of(landscape)
        if canopy is None or self.crown == "none":
            return surface
        fuel, table = self.fuel(landscape), _on(self.table, landscape.cover.device)
        return with_crowns(
            surface,
            canopy,
            Surroundings(**air, moisture=moisture[..., :5]),
            heat=table.fuels.heat[table.index(fuel)] * KILOJOULES_PER_KG,
            foliar_moisture=FOLIAR_MOISTURE if self.foliar_moisture is None else self.foliar_moisture,
            model=self.crown,
            gain=self._factor(fuel),
        )

    def _factor(self, fuel: Tensor) -> Tensor:
        factor = torch.full(fuel.shape, self.rate_gain, device=fuel.device)
        for code, gain in self.fuel_gain.items():
            factor = torch.where(fuel == int(code), factor * gain, factor)
        return factor

    def flammability(self, landscape: Landscape, moisture: Tensor) -> Tensor:
        """Return the square root of each cell's rate on level ground, of the fastest fuel's, float32 [B, H, W]."""
        fuel = self.fuel(landscape)
        codes = torch.arange(int(fuel.min()), int(fuel.max()) + 1, device=fuel.device)
        zero = torch.zeros(1, 1, 1, device=fuel.device)
        air: dict[str, Any] = {"wind_speed": zero + _REFERENCE_WIND}
        air |= dict.fromkeys(("wind_bearing", "slope", "aspect"), zero)
        rule = self._canadian if self.table is None else self._rothermel
        damp = moisture[None].to(fuel.device)
        rates = rule(codes[None, None], _of_cells(damp) if self.table is None else damp, **air)
        share = (rates.head / rates.head.max().clamp(min=1e-6)).sqrt()[0, 0]
        return share.index_select(0, (fuel - codes[0]).flatten().to(torch.int32)).view(fuel.shape)

    def fastest(self, landscape: LandscapeSource, wind: Wind, cell_size: float, moisture: Tensor) -> float:
        """Return the highest rate in a few worlds over the hours that the wind knows [m/min]; 1e-3 at least."""
        key = world_key(torch.arange(_SAMPLES))
        ground = wind.shaped(landscape(key), cell_size)
        rates = [1e-3]
        for air, damp in wind.hours(key, ground):
            rates.append(
                float(self.spread(ground, air, in_force(damp, moisture).expand(len(air), -1), cell_size).head.max())
            )
        return max(rates)


def _on(table: FuelTable | None, device: torch.device) -> FuelTable:
    if table is None:
        raise ValueError("model must be one of Rothermel's, got fbp")
    return table.to(device=device)


def _models(table: FuelTable) -> int:
    """Return the number of rows of a table, filled up to whole vectors."""
    return filled(len(table.fuels.depth))


def _on_map(direction: Tensor, rise: Tensor) -> Tensor:
    """Return how far a way along the ground goes on the map: the cosine of the slope in its direction."""
    angle = torch.deg2rad(direction)
    climb = rise[:, 0] * angle.sin() + rise[:, 1] * angle.cos()
    return torch.rsqrt(1.0 + climb * climb)


def bearing(east: Tensor, north: Tensor) -> Tensor:
    """Return where a vector points, degrees clockwise from grid north in [0, 360)."""
    return torch.rad2deg(torch.atan2(east, north + (north == 0.0) * (east == 0.0))) % 360.0


def _of_cells(moisture: Tensor, world: Tensor | None = None) -> Tensor:
    """Return moistures [B, 7] or [B, H, W, 7] as those of cells, [B, 1, 1, 7] or [B, H, W, 7]; see ``spread``."""
    if world is not None:
        return moisture[world][None]
    return moisture if moisture.dim() == 4 else moisture[:, None, None]
