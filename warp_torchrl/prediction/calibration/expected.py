"""Expected burning: the probability that a cell has burned by an hour, with its gradient by the parameters.

Let all rates of a fire have an unknown factor exp(x), x normal with deviation sigma. A cell burns by hour T if x is at
least x*, the logarithm of the least factor at which the fire comes in time:

    P(burned by T) = Phi(-x* / sigma)

In weather that stays, x* = ln(t / T), t the time of arrival at factor 1. In weather by the hour a fire that stands
still at night is not late by minutes but by a share of its rate, which x* measures. A ladder of factors finds it: on
the lowest rung that comes in time, x* = x_rung - ln(T / t) / k, k = -d ln t / dx, but over the next rung, which does
not come in time. The gradient is that of a level set,

    dx* / dz = -(dt / dz) / (dt / dx)

Times of arrival are sums of durations along the way that won, and their derivatives sums of those of the durations
(the envelope theorem). The law's own engine carries them along by forward differentiation, one group of worlds for
each parameter; rates of spread, which come from tables with thresholds, are differentiated by central differences.
"""

import math
from collections.abc import Sequence
from dataclasses import dataclass

import torch
from torch import Tensor
from torch.autograd import forward_ad

from warp_torchrl.prediction.calibration.candidates import burnable, fires_of
from warp_torchrl.prediction.calibration.case import FireCase
from warp_torchrl.prediction.calibration.parameters import Parameter, fire_at
from warp_torchrl.world.backends.spreading import Hour, Spreading
from warp_torchrl.world.law.rate import RateFire
from warp_torchrl.world.law.travel import NEVER

RUNGS = torch.linspace(-0.6, 0.6, 9)
"""Logarithms of the factors on all rates at which fires are run: from 0.55 to 1.8."""
_STEP = 0.1  # of z, by which rates are differentiated
_STEEPEST = 10.0  # a share of the rate for a unit of z: more is the noise of a cell that was nearly missed
_LEAST = 1e-6


@dataclass(frozen=True, eq=False)
class Margin:
    """By how much the rates may fall until a cell burns no more by an hour.

    Attributes:
        log_factor: x*, float32 [K, H, W]; past the rungs where no fire of the ladder comes.
        gradient: dx* / dz, float32 [P, K, H, W]; 0 past the rungs.
        fuel: Cells that can burn, bool [H, W].
    """

    log_factor: Tensor
    gradient: Tensor
    fuel: Tensor


def margin(fire: RateFire, parameters: Sequence[Parameter], z: Tensor, case: FireCase) -> Margin:
    """Return the margins of each cell of a case, at each hour that is known of it.

    Args:
        fire: The law at z = 0.
        parameters: What moves.
        z: Where it stands, float [P].
        case: The fire.
    """
    law = fire_at(fire, parameters, z)
    fuel = burnable(law, case)
    hours = _hours([law], case)
    tangents = [-hour.travel for hour in hours], *_tangents(fire, parameters, z, case)
    minutes, slopes = differentiated(hours, torch.stack([torch.cat(each) for each in tangents], 1), case, fuel)
    return _margin(minutes, slopes, case.minutes, fuel)


def burning_probability(log_factor: Tensor, deviation: Tensor | float) -> Tensor:
    """Return Phi(-x* / sigma), float32 of one shape.

    Args:
        log_factor: x*.
        deviation: sigma.
    """
    return 0.5 * torch.erfc(log_factor / deviation / math.sqrt(2.0))


def _hours(laws: Sequence[RateFire], case: FireCase) -> list[Hour]:
    """Return the spells of a case under each law, on the whole map."""
    fires = fires_of(laws, case)
    return [fires.hour(number) for number in range(len(fires.spells))]


def _tangents(fire: RateFire, parameters: Sequence[Parameter], z: Tensor, case: FireCase) -> list[list[Tensor]]:
    """Return the derivative of the times of ways by each z, of each spell, float32 [1, 3, H, W]."""
    found = []
    for index in range(len(parameters)):
        step = torch.zeros_like(z)
        step[index] = _STEP
        laws = [fire_at(fire, parameters, z + step), fire_at(fire, parameters, z - step)]
        pairs = (hour.travel for hour in _hours(laws, case))
        found.append([(pair[:1] - pair[1:]) / (2.0 * _STEP) for pair in pairs])
    return found


def differentiated(hours: Sequence[Hour], tangents: Tensor, case: FireCase, fuel: Tensor) -> tuple[Tensor, Tensor]:
    """Return times of arrival on each rung, float32 [R, H, W], and their derivatives [D, R, H, W].

    Args:
        hours: The spells.
        tangents: Of the times of ways in D directions, float32 [spells, D, 3, H, W].
        case: The fire.
        fuel: Cells that can burn, bool [H, W].
    """
    directions, rungs = tangents.shape[1], len(RUNGS)
    size = case.lit.shape
    pace = torch.exp(-RUNGS).repeat(directions)[:, None, None].expand(-1, *size)
    with torch.no_grad(), forward_ad.dual_level():
        carried = [
            Hour(
                forward_ad.make_dual(hour.travel.expand(directions, 3, *size).contiguous(), tangent),
                hour.minutes,
                hour.ticks,
            )
            for hour, tangent in zip(hours, tangents, strict=True)
        ]
        worlds = Spreading(case.lit.expand(directions * rungs, *size), fuel, pace.contiguous())
        worlds.burn(carried)
        minutes, slopes = forward_ad.unpack_dual(worlds.arrival())
    slopes = torch.zeros_like(minutes) if slopes is None else slopes
    return minutes.view(directions, rungs, *size)[0].clone(), slopes.view(directions, rungs, *size).clone()


def _margin(minutes: Tensor, slopes: Tensor, known: Tensor, fuel: Tensor) -> Margin:
    in_time = minutes <= known[:, None, None, None]  # [K, R, H, W]
    rung = in_time.to(torch.int8).argmax(1)  # the first
    time = torch.where(minutes < NEVER / 2, minutes, known[-1]).gather(0, rung).clamp(min=_LEAST)
    slopes = slopes.gather(1, rung.expand(len(slopes), -1, -1, -1))
    by_rate = slopes[0].clamp(max=-_LEAST)
    step = RUNGS[1] - RUNGS[0]
    below = (-time / by_rate * torch.log(known[:, None, None] / time)).clamp(min=0.0)
    below = below / torch.sqrt(1.0 + (below / step).square())  # never past the rung below, which does not come in time
    comes = in_time.any(1)
    factor = torch.where(comes, RUNGS[rung] - below, RUNGS[-1] + step)
    gradient = (-slopes[1:] / by_rate).clamp(-_STEEPEST, _STEEPEST)
    return Margin(factor, torch.where(comes & (time > _LEAST), gradient, 0.0), fuel)
