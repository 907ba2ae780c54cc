"""Posterior of a fire's parameters, and of the parts of its front that are held.

Members that burned since the observation before are the points of an emulator (``world.ensemble.regression``), which
says of any parameters theta how far the front advances in each sector, m(theta), and what they leave open, v. With it
many particles are weighed (Gordon, Salmond and Smith 1993), by the growth y of each sector,

    p(y | theta) = (1 - h) N(y; m(theta), v + u) + h (N(y; none, u) + U(y; none, most, u)) / 2

h is the probability that the front is held there, u what the observation does not show. A held front did not advance,
or stopped on the way to where the member came that went farthest (U, a uniform with the same errors). A front
that was held with probability g at the observation before is so now with

    h = STAYS g + (1 - g) p

p the share of fronts that become held: on most fires 0, on others any. Its posterior is that of a table of shares.
What was learned long ago counts for less: weights are taken to the power e^(-t / tau).
"""

import math
from collections.abc import Sequence
from dataclasses import dataclass

import torch
from torch import Tensor

from warp_torchrl.world.arrays.random import Stream, normal, uniform, world_key
from warp_torchrl.world.ensemble.filtering import jittered, moments, normalised, quantiles, resampled
from warp_torchrl.world.ensemble.parameters import PARAMETERS, Deviations
from warp_torchrl.world.ensemble.regression import Emulator
from warp_torchrl.world.fires.sectors import by_sector
from warp_torchrl.world.fires.sightings import Sight

PARTICLES = 2**16
REMEMBERED = 6.0 * 60.0
"""tau: minutes after which what was learned counts for a third, for errors of rates and winds change."""
STAYS = 0.9
"""Probability that a front that is held is so still at the next observation."""
_SHARES = (0.0, 0.05, 0.1, 0.2, 0.4, 0.6, 0.8, 0.95)  # p
_FAR = 2.0  # beyond the farthest member that growth may be
_SURPRISE = 0.02  # share for growth that no member can say: embers ahead of the front, wrong fuels


@dataclass(frozen=True, eq=False)
class Posterior:
    """What is known of a fire.

    Attributes:
        particles: Parameters, float32 [N, P].
        log_weights: float32 [N].
        held: Of each cell along the last front the probability g that it is held, float32 [H, W]; elsewhere 0.
        log_shares: Logarithms of the weights of shares p, float64 [n].
    """

    particles: Tensor
    log_weights: Tensor
    held: Tensor
    log_shares: Tensor

    @classmethod
    def prior(cls, deviations: Deviations, size: Sequence[int], seed: int) -> "Posterior":
        """Return what is known before anything is seen."""
        particles = deviations.drawn(world_key(torch.tensor([seed])), (PARTICLES,))[0]
        some = min(1.0, deviations.held * (len(_SHARES) - 1) / sum(_SHARES)) / (len(_SHARES) - 1)
        shares = torch.tensor([1.0 - some * (len(_SHARES) - 1)] + [some] * (len(_SHARES) - 1), dtype=torch.float64)
        return cls(particles, torch.zeros(PARTICLES), torch.zeros(*size), shares.log())

    @property
    def weights(self) -> Tensor:
        """Return weights that sum to 1, float32 [N]."""
        return normalised(self.log_weights[None])[0]

    def held_by_sector(self, sector: Tensor, edge: Tensor) -> Tensor:
        """Return the probability of each sector's front to be held from now on, float32 [S].

        Args:
            sector: The sector of each cell, int64 [H, W].
            edge: Cells along the front, bool [H, W].
        """
        return self._chances(sector, edge).T.float() @ self.log_shares.softmax(0).float()

    def _chances(self, sector: Tensor, edge: Tensor) -> Tensor:
        """Return h of each share and sector, float64 [n, S]; see ``held_by_sector``."""
        along = by_sector(edge[None], sector)[0].clamp(min=1.0)
        before = (by_sector((self.held * edge)[None], sector)[0] / along).double()
        return before * STAYS + (1.0 - before) * torch.tensor(_SHARES, dtype=torch.float64)[:, None]

    def drawn(self, key: Tensor, tick: int, shrinkage: float) -> Tensor:
        """Return the parameters of members of equal weight, float32 [K, P].

        Args:
            key: Of the members, int64 [K].
            tick: Of the draws.
            shrinkage: Of the kernel that moves them, see ``filtering.jittered``.
        """
        weights = self.weights[None]
        place = uniform(key[:1], tick, Stream.MEMBERS, (1,))[:, 0]
        taken = self.particles[resampled(weights, place, len(key))[0]]
        noise = normal(key, tick + 1, Stream.MEMBERS, (len(PARAMETERS),))
        return jittered(taken[None], *moments(self.particles[None], weights), noise[None], shrinkage)[0]

    def quantiles(self, values: Tensor, shares: Sequence[float]) -> list[float]:
        """Return quantiles of what each particle is, float32 [N]."""
        return quantiles(values[None], self.weights[None], torch.tensor(shares))[0].tolist()

    def learned(
        self, values: Tensor, said: Tensor, sight: Sight, edges: tuple[Tensor, Tensor], lead: float
    ) -> "Posterior":
        """Return what is known after an observation.

        Args:
            values: Parameters of the members that burned, float32 [K, P].
            said: Their growth by sector, float32 [K, S].
            sight: What was seen.
            edges: Cells along the front before, and those along the front now, bool [H, W].
            lead: Minutes since the observation before.
        """
        mean, variance = Emulator.fitted(values, said)(self.particles)
        span = (said.max(0).values - sight.none).double().clamp(min=0.01)
        as_open = (1.0 - _SURPRISE) * _normal(sight.seen - mean, variance + sight.variance) + _SURPRISE / (span + _FAR)
        grown, sure = (sight.seen - sight.none).double(), sight.variance.double()
        as_held = (_normal(grown, sure) + _within(grown, span, sure)) / 2.0
        power, chances = math.exp(-lead / REMEMBERED), self._chances(sight.sector, edges[0])
        each = [torch.log((1.0 - chance) * as_open + chance * as_held).sum(1) for chance in chances]
        joint = torch.stack(each) + power * (self.log_weights.double() + self.log_shares[:, None])  # [n, N]
        joint = joint - joint.max()
        weights = (joint - joint.logsumexp((0, 1))).exp()
        held = torch.stack(
            [
                weight @ (chance * as_held / ((1.0 - chance) * as_open + chance * as_held))
                for weight, chance in zip(weights, chances, strict=True)
            ]
        ).sum(0)
        return Posterior(
            self.particles,
            joint.logsumexp(0).float(),
            torch.where(edges[1], held.float()[sight.sector], 0.0),
            joint.logsumexp(1),
        )


def _normal(off: Tensor, variance: Tensor) -> Tensor:
    return torch.exp(-0.5 * off.square() / variance) / (2.0 * torch.pi * variance).sqrt()


def _within(grown: Tensor, span: Tensor, variance: Tensor) -> Tensor:
    """Return the density of a uniform in 0..span with normal errors."""
    scale = (2.0 * variance).sqrt()
    return 0.5 * (torch.erf(grown / scale) - torch.erf((grown - span) / scale)) / span
