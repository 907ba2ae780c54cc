"""Firebrands: how many a fire throws, how far they fly, and whether they ignite what they land on.

- Number: in proportion to the heat that a cell releases, as in pyretechnics.
- Distance along the wind: log-normal, by fireline intensity and wind (Sardoy, Consalvi, Kaiss, Fernandez-Pello and
  Porterie 2008). Across it: normal (Himoto and Tanaka 2005).
- Survival of the flight: exponential (Perryman, Dugaw, Varner and Johnson 2013).
- Ignition: by temperature and moisture of fine dead fuel (Schroeder 1969).
- Time: lofting and fall (Albini 1979) and the build-up of the new fire (Perryman et al. 2013).
"""

import math
from dataclasses import dataclass

import torch
from torch import Tensor

from warp_torchrl.validation import check_fields

FLIGHT, LANDING = ("embers.along", "embers.across"), "embers.landing"
"""Names of the draws of distances along and across the wind, and of ignition."""
_GRAVITY = 9.81  # m/s2
_HEAT_OF_AIR = 1.1 * 1.0 * 300.0  # density [kg/m3] x heat capacity [kJ/kg/K] x temperature [K] (Sardoy et al. 2008)
_SLOWEST = 3.0
"""Wind [m/s] under which distances shrink with the wind: the equation of buoyant plumes has no bound there."""
_SIDEWAYS = 0.92  # standard deviation across the wind over the length of the plume (Himoto and Tanaka 2005)
_HIGHEST = 117.0  # m, to which firebrands of 3 mm rise (Albini 1979)
_LEAST = 1e-6


@dataclass(frozen=True, eq=False)
class Plume:
    """The fire under some cells as it throws firebrands; all fields have one shape."""

    intensity: Tensor  # fireline intensity [kW/m]
    flame_length: Tensor  # [m]
    number: Tensor  # firebrands
    east: Tensor  # wind at 10 m [m/s]
    north: Tensor


@dataclass(frozen=True, eq=False)
class Flight:
    """Firebrands in flight, some of each plume; all fields are [..., M]."""

    east: Tensor  # from where they rose to where they land [m]
    north: Tensor
    number: Tensor  # firebrands that each stands for, of those that land aglow


@dataclass(frozen=True, kw_only=True)
class Firebrands:
    """Firebrands of fires in metres and minutes.

    Attributes:
        per_heat: Firebrands that can ignite something, for each gigajoule that a cell releases. The least known number:
            sources have 5e-5 to 100.
        least_intensity: Fireline intensity from which a fire throws any [kW/m]; as in ELMFIRE's example.
        decay: Distance after which a share of 1/e still glows [m].
        temperature: Of the air, by which fuel ignites [C].
        delay: Minutes from the landing until the new fire spreads. Then it has its full rate.
        followed: Firebrands of each cell that are followed; each stands for its share of all.

    Raises:
        ValueError: If a value is out of its range.
    """

    per_heat: float = 1.0
    least_intensity: float = 2000.0
    decay: float = 200.0
    temperature: float = 25.0
    delay: float = 20.0
    followed: int = 16

    def __post_init__(self) -> None:
        check_fields(
            self,
            per_heat=(0.0, 1e5),
            least_intensity=(0.0, 1e6),
            decay=(1.0, 1e6),
            temperature=(-30.0, 60.0),
            delay=(0.0, 1440.0),
            followed=(1, 1024),
        )

    def number(self, intensity: Tensor, rate: Tensor, area: float) -> Tensor:
        """Return how many firebrands a burning cell throws: ``per_heat`` times 60 I / R kJ/m2, over its area.

        Args:
            intensity: I, of the front as it comes [kW/m].
            rate: R, of its spread [m/min].
            area: Of the cell [m2].
        """
        heat = 60e-6 * area * intensity / rate.clamp(min=_LEAST)
        return self.per_heat * heat * (intensity >= self.least_intensity)

    def flown(self, plume: Plume, along: Tensor, across: Tensor) -> Flight:
        """Return the flight of firebrands from uniform draws in [0, 1), float32 [..., M].

        The draws along the wind are stratified: the m-th firebrand has the m-th part of the distances. So a few
        firebrands have the right mean.
        """
        each = torch.arange(along.shape[-1], device=along.device)
        speed = torch.sqrt(plume.east.square() + plume.north.square())
        mu, sigma, sideways = landing(plume.intensity, speed)
        part = (each + along) / along.shape[-1]
        calm = (speed / _SLOWEST).clamp(max=1.0)
        downwind = calm[..., None] * lognormal(mu[..., None], sigma[..., None], part)
        aside = (calm * sideways)[..., None] * normal_of(across)
        east, north = (each[..., None] / speed.clamp(min=_LEAST)[..., None] for each in (plume.east, plume.north))
        survives = torch.exp(-torch.sqrt(downwind.square() + aside.square()) / self.decay)
        return Flight(
            east=east * downwind + north * aside,
            north=north * downwind - east * aside,
            number=plume.number[..., None] / along.shape[-1] * survives,
        )

    def ignition(self, moisture: Tensor) -> Tensor:
        """Return the chance that a firebrand ignites fuel of some moisture [% of dry weight], see ``ignition_chance``.

        Very damp fuel has a chance of almost 0.
        """
        return ignition_chance(self.temperature, moisture)

    def minutes(self, plume: Plume) -> Tensor:
        """Return the minutes between the arrival of a fire and the spread of its spot fires."""
        return 2.0 * flight_minutes(plume.flame_length) + self.delay


def landing(intensity: Tensor, wind_speed: Tensor) -> tuple[Tensor, Tensor, Tensor]:
    """Return mean and standard deviation of ln(distance along the wind [m]), and standard deviation across it [m].

        L = (I / (rho c T sqrt(g)))^(2/3),    Fr = U / sqrt(g L)
        mu = 1.47 I^0.54 U^-0.55 + 1.14,  sigma = 0.86 I^-0.21 U^0.44 + 0.19      where Fr <= 1, of buoyant plumes
        mu = 1.32 I^0.26 U^0.11 - 0.02,   sigma = 4.95 I^-0.01 U^-0.02 - 3.48     where Fr > 1, of plumes in wind

    I is in MW/m there (Sardoy et al. 2008). Across the wind it is 0.92 L (Himoto and Tanaka 2005).

    Args:
        intensity: Fireline intensity [kW/m].
        wind_speed: U, at 10 m [m/s]; at least 3 is taken.
    """
    wind, strength = wind_speed.clamp(min=_SLOWEST), intensity.clamp(min=1.0)
    length = torch.exp((strength / (_HEAT_OF_AIR * math.sqrt(_GRAVITY))).log() * (2.0 / 3.0))
    buoyant = wind.square() <= _GRAVITY * length
    ln_i, ln_u = (strength / 1000.0).log(), wind.log()
    mu = torch.where(
        buoyant, 1.47 * torch.exp(0.54 * ln_i - 0.55 * ln_u) + 1.14, 1.32 * torch.exp(0.26 * ln_i + 0.11 * ln_u) - 0.02
    )
    sigma = torch.where(
        buoyant, 0.86 * torch.exp(0.44 * ln_u - 0.21 * ln_i) + 0.19, 4.95 * torch.exp(-0.01 * ln_i - 0.02 * ln_u) - 3.48
    )
    return mu, sigma, _SIDEWAYS * length


def ignition_chance(temperature: float, moisture: Tensor) -> Tensor:
    """Return the chance that a firebrand ignites fine dead fuel (Schroeder 1969).

        Q = 144.5 - 0.266 T - 0.00058 T^2 - T m + 18.54 (1 - exp(-15.1 m)) + 640 m
        P = 0.000048 x^4.3 / 50,   x = (400 - Q) / 10

    Args:
        temperature: T, of the fuel before [C].
        moisture: 100 m, of the fuel [% of dry weight].
    """
    m = moisture / 100.0
    dry = 144.512 - 0.266 * temperature - 0.00058 * temperature**2
    heat = dry - temperature * m - 18.54 * torch.expm1(-15.1 * m) + 640.0 * m
    x = ((400.0 - heat) / 10.0).clamp(min=_LEAST)
    return (0.000048 / 50.0 * torch.exp(4.3 * x.log())).clamp(max=1.0)


def flight_minutes(flame_length: Tensor) -> Tensor:
    """Return how long firebrands rise [minutes] (Albini 1979, D43). They fall for about as long.

        t = 2 z / w (1.2 + a / 3 (((b + h / z) / a)^1.5 - 1)),   w = 2.3 sqrt(z), a = 5.963, b = 4.563, h = 117 m

    Args:
        flame_length: z [m].
    """
    z = flame_length.clamp(min=_LEAST)
    height = (4.563 + _HIGHEST / z) / 5.963
    return 2.0 / 2.3 * z.sqrt() / 60.0 * (1.2 + 5.963 / 3.0 * (height * height.sqrt() - 1.0))


def lognormal(mu: Tensor, sigma: Tensor, u: Tensor) -> Tensor:
    """Return log-normal numbers from uniform draws in [0, 1).

    Args:
        mu: Mean of the logarithm.
        sigma: Its standard deviation.
        u: The draws.
    """
    return torch.exp(mu + sigma * normal_of(u))


def normal_of(u: Tensor) -> Tensor:
    """Return the standard normals of uniform draws in [0, 1)."""
    return math.sqrt(2.0) * torch.erfinv((2.0 * u - 1.0).clamp(-1.0 + 1e-6, 1.0 - 1e-6))
