"""Emulator: what members did as a quadratic function of their parameters, so that thousands of others need not burn.

    y = c_0 + c^T z + z^T C z + e,    z the parameters less their mean, in standard deviations

Each result has a separate regression (Box and Wilson 1951), with a ridge (Hoerl and Kennard 1970) that is chosen by
leaving one member out. The mean square of those errors is the variance of e: what parameters do not explain. The
variance of a prediction grows with x^T A^-1 x, x the terms and A = X^T X + ridge: far from the members little is known.
"""

from dataclasses import dataclass

import torch
from torch import Tensor

_RIDGES = (0.03, 1.0, 30.0, 1000.0)  # on quadratic terms; linear ones have a thirtieth, the constant none
_LEAST = 1e-4  # of scales: parameters that do not differ are left out


@dataclass(frozen=True, eq=False)
class Emulator:
    """Regression of S results on P parameters.

    Attributes:
        mean: Of the parameters of the members, float64 [P].
        scale: Their standard deviations, float64 [P].
        coefficients: float64 [Q, S].
        variance: Of e, float64 [S].
        inverse: A^-1 of each ridge, float64 [R, Q, Q].
        ridge: Which was chosen, int64 [S].
    """

    mean: Tensor
    scale: Tensor
    coefficients: Tensor
    variance: Tensor
    inverse: Tensor
    ridge: Tensor

    @classmethod
    def fitted(cls, values: Tensor, results: Tensor) -> "Emulator":
        """Return the emulator of members.

        Args:
            values: Their parameters, float [K, P].
            results: What they did, float [K, S].
        """
        values, results = values.double(), results.double()
        mean, scale = values.mean(0), values.std(0, correction=0).clamp(min=_LEAST)
        terms, order = _terms((values - mean) / scale)
        inverse = torch.linalg.inv(terms.T @ terms + torch.stack([(each * order).diag() for each in _RIDGES]))
        coefficients = inverse @ (terms.T @ results)  # [R, Q, S]
        leverage = torch.einsum("kp,rpq,kq->rk", terms, inverse, terms)
        left_out = (results - terms @ coefficients) / (1.0 - leverage).clamp(min=0.05)[..., None]
        errors = left_out.square().mean(1)
        ridge = errors.argmin(0)
        chosen = coefficients.gather(0, ridge.expand(1, terms.shape[1], -1))[0]
        return cls(mean, scale, chosen, errors.min(0).values, inverse, ridge)

    def __call__(self, values: Tensor) -> tuple[Tensor, Tensor]:
        """Return the results of other parameters, float [N, P], and their variance, float64 [N, S] both."""
        terms, _ = _terms((values.double() - self.mean) / self.scale)
        far = torch.stack([((terms @ each) * terms).sum(1) for each in self.inverse], dim=1)  # [N, R]
        return terms @ self.coefficients, self.variance * (1.0 + far[:, self.ridge])


def _terms(z: Tensor) -> tuple[Tensor, Tensor]:
    """Return 1, z and the products of z, float64 [n, Q], and the ridge of each by a factor, float64 [Q]."""
    first, second = torch.triu_indices(z.shape[1], z.shape[1])
    terms = torch.cat((torch.ones_like(z[:, :1]), z, z[:, first] * z[:, second]), dim=1)
    order = torch.cat((z.new_full((1,), 1e-9), z.new_full((z.shape[1],), 1.0 / 30.0), z.new_ones(len(first))))
    return terms, order
