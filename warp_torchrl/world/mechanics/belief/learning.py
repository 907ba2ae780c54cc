"""Learning of the wind and the rate of spread: particles without maps, which the fire's edge weighs.

A particle is a rate and a wind, theta. At each tick the trees beside the known fire burn or do not, and the law says
how likely each was to ignite under each theta. Particles of little weight are replaced (Gordon, Salmond and Smith 1993)
and moved by a kernel that keeps mean and variance (Liu and West 2001). Members take their parameters from them.
"""

import math
from dataclasses import dataclass

import torch
from torch import Tensor
from torch.nn.functional import pad

from warp_torchrl.system.device import needs_no_sync
from warp_torchrl.world.arrays.batch import Batch
from warp_torchrl.world.arrays.geometry import DIRECTIONS, grow
from warp_torchrl.world.arrays.listing import list_cells
from warp_torchrl.world.arrays.random import Stream, log_deviation, named_key, normal, uniform
from warp_torchrl.world.ensemble.filtering import effective, exponent, jittered, moments, normalised, resampled
from warp_torchrl.world.ensemble.members import in_other_air
from warp_torchrl.world.law.automaton import Automaton, Beside, at_cells
from warp_torchrl.world.state.cells import is_tree
from warp_torchrl.world.state.records import read
from warp_torchrl.world.state.state import Air, WorldState

PARAMETERS = ("rate", "wind_speed", "bearing")
_FINE = 2.0**20
"""Logarithms of likelihoods are added as whole multiples of 1 / this, so that sums are the same in any batch."""
_LEAST = 1e-3
"""Least chance of what is seen of a tree: laws and maps are never quite right."""
_POOR = 0.5
"""Share of the particles under which, by their effective number, they are drawn again."""
_STAGES = 4
_TINY = 1e-30
NOT_BESIDE, UNSEEN, STANDS, BURNS = range(4)
"""What is known of a cell since the last tick: no tree beside known fire then, or one that was seen since, or not."""

OF_WORLD = ("hidden", "prior", "wind", "moisture")
"""What of ``Learning`` all beliefs of a world have in common."""


@dataclass(eq=False, repr=False)
class Learning(Batch):
    """What teams know of wind and rate of spread, see ``members.in_parameters`` for the parameters."""

    members: Tensor  # float32 [B,G,K,3], parameters of the members
    hidden: Tensor  # float32 [B,M,3], parameters of the hidden fires
    particles: Tensor  # float32 [B,G,P,3]
    weights: Tensor  # float32 [B,G,P], of the particles; their sum is 1
    prior: Tensor  # float32 [B,3], standard deviations before anything is seen
    spreads: Tensor  # float32 [B,G,H,W], chance that each cell spread fire at the last tick
    burned: Tensor  # float32 [B,G,H,W], chance that each cell burned before it
    outcome: Tensor  # uint8 [B,G,H,W], ``NOT_BESIDE`` ... ``BURNS``
    wind: Tensor  # float32 [B,2,h,w], at the last tick [m/s]
    moisture: Tensor | None  # of ``Wind.moisture``, at the last tick


def begun(
    state: WorldState, key: Tensor, deviations: tuple[float, float, float], counts: tuple[int, int, int, int]
) -> Learning:
    """Return what teams know before they have seen anything.

    The estimate is off the true value by a draw of the deviations, and the particles are off the estimate as much.

    Args:
        state: The worlds.
        key: Of the draws, int64 [B].
        deviations: Coefficients of variation of rate and wind speed, and standard deviation of the bearing [degrees].
        counts: G, K, M and P.
    """
    groups, members, hidden, particles = counts
    spread = [log_deviation(each) for each in deviations[:2]]
    scale = torch.tensor([*spread, math.radians(deviations[2])], device=key.device)
    draws = normal(key, 0, Stream.MEMBERS, (1 + groups * (members + particles) + hidden, len(PARAMETERS)))
    values = (draws[:, :1] + draws[:, 1:]) * scale
    own, lit = values[:, hidden:].unflatten(1, (groups, -1)), values[:, :hidden]
    none = state.alpha.new_zeros(len(key), groups, *state.alpha.shape[1:])
    return Learning(
        members=own[:, :, :members],
        hidden=lit,
        particles=own[:, :, members:],
        weights=torch.full((len(key), groups, particles), 1.0 / particles, device=key.device),
        prior=scale.expand(len(key), -1).contiguous(),
        spreads=none,
        burned=none.clone(),
        outcome=torch.zeros_like(none, dtype=torch.uint8),
        wind=state.wind.clone(),
        moisture=None if state.air.moisture is None else state.air.moisture.clone(),
    )


def watched(
    state: WorldState, known: Learning, planes: tuple[Tensor, Tensor, Tensor], records: Tensor, since: Tensor
) -> Learning:
    """Return what is kept of the fire's edge before a tick: the trees that it may reach, all about which was seen.

    Args:
        state: The worlds before the tick.
        known: What is known of wind and rate.
        planes: Chances of each cell to spread fire and to burn, float32 [B, G, H, W], and the trees that can ignite.
        records: The newest of each belief, int32 [B, G, H, W].
        since: Records of the step of the tick before are at least this, int32 [B].
    """
    spreads, burned, fuel = planes
    code, _, _ = read(records)
    is_seen = records >= since[:, None, None, None]
    is_sure = is_seen | (code == 0) | (state.alpha == 0.0)[:, None]
    edge = is_seen & fuel & is_tree(code) & grow(spreads > 0.0) & ~grow(~is_sure)
    return known.replace(
        spreads=spreads,
        burned=burned,
        outcome=edge.to(torch.uint8) * UNSEEN,
        wind=state.wind,
        moisture=state.air.moisture,
    )


def noted(known: Learning, cell: Tensor, first: Tensor, burns: Tensor) -> Learning:
    """Return with what is seen of the trees beside the fire, for the first time since the tick.

    Args:
        known: What is known of wind and rate.
        cell: That are seen, int64 [B, G, n].
        first: For the first time, bool [B, G, n].
        burns: That burn, bool [B, G, n].
    """
    outcome = known.outcome.flatten(2)
    before = outcome.gather(2, cell)
    after = torch.where(first & (before == UNSEEN), torch.where(burns, BURNS, STANDS), before).to(torch.uint8)
    return known.replace(outcome=outcome.scatter(2, cell, after).view_as(known.outcome))


def learned(state: WorldState, known: Learning, fire: Automaton, errors: tuple[float, float], now: Tensor) -> Learning:
    """Return what is known after the trees beside the fire of the last tick have weighed the particles.

        log L = sum log(b p' + (1 - b) (1 - p')),   p' = p (1 - miss) + (1 - p) false_alarm,   p = c + (1 - c) q(theta)

    b is 1 where a tree is seen to burn, else 0; q(theta) is its chance to ignite, and c that it burned before. Where
    few particles would count, a power of L weighs them that leaves half of them, they are drawn again and moved, and
    the rest of L weighs these (Del Moral, Doucet and Jasra 2006).

    Args:
        state: The worlds before the next tick.
        known: What was known.
        fire: The automaton.
        errors: ``miss`` and ``false_alarm``.
        now: The worlds that learn, bool [B].
    """
    groups = known.weights.shape[1]
    outcome = known.outcome.flatten(0, 1)
    cell, there = list_cells((outcome >= STANDS) & now.repeat_interleave(groups)[:, None, None])
    left, reads = torch.ones_like(known.weights[..., 0]), needs_no_sync(now.device)
    if reads and not there.any():
        return known
    for stage in range(_STAGES):
        likelihood = _likelihood(state, known, fire, errors, cell, there)
        log = known.weights.clamp(min=_TINY).log().flatten(0, 1)
        last = stage == _STAGES - 1
        half = _POOR * log.shape[1]
        power = left if last else exponent(log, likelihood, half, left.flatten()).view_as(left)
        weights = normalised(log + power.flatten()[:, None] * likelihood).view_as(known.weights)
        left = left - power
        known = _drawn_again(state, known.replace(weights=weights), left > 0.0, stage)
        if reads and not left.any():
            break
    return known


def _likelihood(
    state: WorldState, known: Learning, fire: Automaton, errors: tuple[float, float], cell: Tensor, there: Tensor
) -> Tensor:
    """Return log L of the particles, float32 [B * G, P], by the trees that are ``there``; see ``learned``."""
    groups, count = known.weights.shape[1:]
    rows = torch.arange(len(state.key), device=cell.device).repeat_interleave(groups)
    values, each = known.particles.flatten(0, 1), rows.repeat_interleave(count)
    wind = in_other_air(known.wind[each], values.flatten(0, 1))
    air = Air(wind, None if known.moisture is None else known.moisture[each])
    beside = Beside(cell, _sources(known.spreads.flatten(0, 1), cell))
    ignites = fire.ignition_beside(state if groups == 1 else state[rows], beside, values[..., 0].exp(), air)
    before = beside.of(known.burned.flatten(0, 1))[:, None]
    p = before + (1.0 - before) * ignites
    p = (p * (1.0 - errors[0]) + (1.0 - p) * errors[1]).clamp(_LEAST, 1.0 - _LEAST)
    burns = beside.of(known.outcome.flatten(0, 1))[:, None] == BURNS
    log = torch.where(burns, p, 1.0 - p).log() * there[:, None]
    return (log * _FINE).round().to(torch.int64).sum(dim=2).to(torch.float32) / _FINE


def _sources(spreads: Tensor, cell: Tensor) -> Tensor:
    """Return how likely each neighbour of cells spreads fire, float32 [B, 8, n], by the direction of travel."""
    width = spreads.shape[2]
    wide = pad(spreads, (1, 1, 1, 1))
    row, column = cell // width + 1, cell % width + 1
    return torch.stack(
        [at_cells(wide, (row - down) * (width + 2) + column - right) for down, right in DIRECTIONS], dim=1
    )


def _drawn_again(state: WorldState, known: Learning, must: Tensor, stage: int) -> Learning:
    """Return with particles drawn again where few count, or they ``must``, bool [B, G].

    There members and hidden fires take other parameters.
    """
    groups, count = known.weights.shape[1:]
    weights, particles = known.weights.flatten(0, 1), known.particles.flatten(0, 1)
    poor = must.flatten() | (effective(weights) < _POOR * count)
    key = named_key(state.key, "learning")
    now = state.tick * _STAGES + stage
    draw = uniform(key, now, Stream.MEMBERS, (3, groups))

    def taken(number: int, draw: Tensor) -> Tensor:
        index = resampled(weights, draw.flatten(), number)
        return particles.gather(1, index[..., None].expand(-1, -1, particles.shape[2])).unflatten(0, (-1, groups))

    noise = normal(key, now, Stream.PACE, (groups, *particles.shape[1:])).flatten(0, 1)
    moved = jittered(taken(count, draw[:, 0]).flatten(0, 1), *moments(particles, weights), noise)
    poor = poor.view(-1, groups, 1)
    hidden = known.hidden
    if hidden.shape[1]:
        each = torch.arange(hidden.shape[1], device=hidden.device)
        other = taken(hidden.shape[1], draw[:, 1])[:, each % groups, each]
        hidden = torch.where(poor[:, each % groups], other, hidden)
    return known.replace(
        members=torch.where(poor[..., None], taken(known.members.shape[2], draw[:, 2]), known.members),
        hidden=hidden,
        particles=torch.where(poor[..., None], moved.unflatten(0, (-1, groups)), known.particles),
        weights=torch.where(poor, 1.0 / count, known.weights),
    )
