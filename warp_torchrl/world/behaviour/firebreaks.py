"""Firebreaks: whether flames breach one."""

import torch
from torch import Tensor

_STRONGEST = 17_000.0  # kW/m, of the fires in the experiments
_PLOT = 100.0  # m, side of the smallest plots there, of one hectare


def breach_chance(intensity: Tensor, width: float, trees: Tensor, length: float) -> Tensor:
    """Return the chance that a fire breaches a part of a firebreak, from 113 grass fires at 1.5 to 15 m (Wilson 1988).

        P = 1 / (1 + exp(-x)),   x = 1.36 + 0.00036 I - b W,   b = 0.38 with trees within 20 m, else 0.99

    It is that of a front as wide as a plot, 100 m; a shorter part has 1 - (1 - P)^(length / 100).

    Args:
        intensity: I, fireline intensity [kW/m]; 17,000 at most, that of the strongest fire there.
        width: W, of the firebreak [m].
        trees: Whether trees stand beside it, bool.
        length: Of the part [m].
    """
    fall = torch.where(trees, 0.38, 0.99) * width
    x = 1.36 + 0.00036 * intensity.clamp(max=_STRONGEST) - fall
    return -torch.expm1(-length / _PLOT * torch.nn.functional.softplus(x))


def holds_up_to(draw: Tensor, width: Tensor, trees: bool, length: float) -> Tensor:
    """Return the intensity up to which parts of firebreaks hold, float32 [kW/m]: the inverse of ``breach_chance``.

    Args:
        draw: Uniform in [0, 1): the part is breached by fires whose chance is higher.
        width: See there, float32 [m].
        trees: See there.
        length: See there.
    """
    x = torch.expm1(-torch.log1p(-draw) * (_PLOT / length)).log() + (0.38 if trees else 0.99) * width
    return torch.where(x < 1.36 + 0.00036 * _STRONGEST, (x - 1.36) / 0.00036, torch.inf)


def intensity_of(flame_length: float) -> float:
    """Return the fireline intensity of flames of a length [m], (L / 0.0775)^(1 / 0.46) [kW/m] (Byram 1959)."""
    return float((flame_length / 0.0775) ** (1.0 / 0.46))
