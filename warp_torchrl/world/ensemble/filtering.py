"""Particle filter: weights of an ensemble's members, resampling, and a kernel that moves their parameters.

Members are weighed by the likelihood of what was seen (Gordon, Salmond and Smith 1993). Where few of them hold most of
the weight, members are drawn by systematic resampling (Kitagawa 1996), and their parameters are moved by a kernel that
keeps mean and variance (Liu and West 2001). B filters of K members run at once; each gives the same in any batch.
"""

import torch
from torch import Tensor

_LEAST = 1e-12
_ROUNDING = 1e-6  # of sums of weights


def normalised(log_weights: Tensor) -> Tensor:
    """Return weights that sum to 1, float [B, K]; equal ones where every likelihood is 0.

    Args:
        log_weights: Logarithms of likelihoods, float [B, K]; -inf is a likelihood of 0.
    """
    highest = log_weights.max(dim=1, keepdim=True).values
    known = torch.where(highest > -torch.inf, log_weights - highest, torch.zeros_like(log_weights))
    shares = known.exp()
    return shares / shares.sum(dim=1, keepdim=True)


def effective(weights: Tensor) -> Tensor:
    """Return the effective number of members, 1 / sum of w^2, float [B] (Kong, Liu and Wong 1994).

    Args:
        weights: That sum to 1, float [B, K].
    """
    return 1.0 / weights.square().sum(dim=1)


def resampled(weights: Tensor, draw: Tensor, places: int | None = None) -> Tensor:
    """Return the member that each place takes, int64 [B, n], by systematic resampling (Kitagawa 1996).

    Place k takes the first member whose cumulative weight is over (k + u) / n: a member of weight w is taken n w times,
    rounded up or down. Members without weight are never taken.

    Args:
        weights: That sum to 1, float [B, K].
        draw: u, one uniform draw in [0, 1) for each filter, float [B].
        places: n; None is K.
    """
    count = weights.shape[1] if places is None else places
    total = weights.to(torch.float64).cumsum(dim=1)
    total = total / total[:, -1:]
    at = torch.arange(count, dtype=torch.float64, device=weights.device) + draw.to(torch.float64)[:, None]
    return torch.searchsorted(total, (at / count).contiguous(), right=True)


def exponent(log_weights: Tensor, log_likelihood: Tensor, least: Tensor | float, most: Tensor | float = 1.0) -> Tensor:
    """Return the highest power of the likelihoods that leaves an effective number of members, float [B].

    Likelihoods are tempered where few members would hold all the weight (Neal 2001; Del Moral, Doucet and Jasra 2006).
    Found by bisection, to 2^-20 of ``most``.

    Args:
        log_weights: Of the members before, float [B, K].
        log_likelihood: float [B, K].
        least: Effective number, float [B] or one number; the power is 0 where it is less already.
        most: Highest power, float [B] or one number.
    """
    low = torch.zeros_like(log_weights[:, 0])
    high = low + most
    top = high

    def leaves(power: Tensor) -> Tensor:
        return effective(normalised(log_weights + power[:, None] * log_likelihood)) >= least

    whole = leaves(top)
    for _ in range(20):
        middle = (low + high) / 2.0
        enough = leaves(middle)
        low, high = torch.where(enough, middle, low), torch.where(enough, high, middle)
    return torch.where(whole, top, low)


def moments(values: Tensor, weights: Tensor) -> tuple[Tensor, Tensor]:
    """Return the weighted mean, float [B, P], and covariance, float [B, P, P], of parameters.

    Args:
        values: float [B, K, P].
        weights: That sum to 1, float [B, K].
    """
    mean = (weights[:, :, None] * values).sum(dim=1)
    off = values - mean[:, None]
    return mean, torch.einsum("bk,bkp,bkq->bpq", weights, off, off)


def jittered(values: Tensor, mean: Tensor, covariance: Tensor, noise: Tensor, shrinkage: float = 0.97) -> Tensor:
    """Return parameters that were moved without a change of their mean and variance, float [B, K, P].

        theta' = a theta + (1 - a) mean + sqrt(1 - a^2) L z,    L L^T the covariance    (Liu and West 2001)

    Args:
        values: theta of the members that were taken, float [B, K, P].
        mean: Before they were taken, see ``moments``, float [B, P].
        covariance: The same, float [B, P, P].
        noise: z, standard normal draws, float [B, K, P].
        shrinkage: a, in 0..1; 0.97 is a discount factor of 0.944.
    """
    scale = covariance.diagonal(dim1=1, dim2=2).clamp(min=_LEAST)
    ridge = torch.diag_embed(scale * 1e-6)
    factor = torch.linalg.cholesky_ex(covariance.to(torch.float64) + ridge.to(torch.float64)).L.to(values.dtype)
    moved = (1.0 - shrinkage**2) ** 0.5 * torch.einsum("bpq,bkq->bkp", factor, noise)
    return shrinkage * values + (1.0 - shrinkage) * mean[:, None] + moved


def quantiles(values: Tensor, weights: Tensor, shares: Tensor) -> Tensor:
    """Return weighted quantiles, float [B, Q]: the least values up to which at least these shares of the weight lie.

    Args:
        values: float [B, K].
        weights: That sum to 1, float [B, K].
        shares: In 0..1, float [Q].
    """
    order = values.argsort(dim=1, stable=True)
    total = weights.gather(1, order).to(torch.float64).cumsum(dim=1)
    total = total / total[:, -1:]
    wanted = shares.to(torch.float64).expand(len(values), -1).contiguous() - _ROUNDING
    place = torch.searchsorted(total, wanted).clamp(max=values.shape[1] - 1)
    return values.gather(1, order).gather(1, place)
