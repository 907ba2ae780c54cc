"""Fit of beliefs to the fire: what is counted after every step, and the metrics that it makes."""

from collections.abc import Sequence

import torch
from torch import Tensor

from warp_torchrl.world.ensemble.filtering import moments, quantiles
from warp_torchrl.world.mechanics.belief.beliefs import Beliefs, known_probability

_ERRORS = 1 << 16


def counted(beliefs: Beliefs, burns: Tensor, running: Tensor, threshold: float) -> Beliefs:
    """Return beliefs whose counts hold one more step.

    Args:
        beliefs: After the step.
        burns: Cells that burn, bool [B, H, W].
        running: Worlds that go on, bool [B].
        threshold: Chance over which a cell is taken to burn.
    """
    p = known_probability(beliefs)
    thought, skill = p > threshold, brier_skill(p, burns)
    overlap, union = ((burns[:, None] & thought).sum((1, 2, 3)), (burns[:, None] | thought).sum((1, 2, 3)))
    return beliefs.replace(
        overlap=beliefs.overlap + (overlap * running).to(torch.int32),
        union=beliefs.union + (union * running).to(torch.int32),
        skill=torch.where(running, skill, beliefs.skill),
        skills=beliefs.skills + skill * running,
        alight=beliefs.alight + (burns.flatten(1).any(dim=1) & running).to(torch.int32),
    )


def brier_skill(p: Tensor, burns: Tensor) -> Tensor:
    """Return how much less a belief errs than one in which nothing burns, float32 [B] (Brier 1950).

        S = 1 - sum (p - y)^2 / sum y^2,   sums over the cells, and the mean over a world's beliefs

    It is 1 where the belief is right everywhere, and 0 where nothing burns. Sums are of whole numbers, errors of
    1 / 65,536, so that they are the same in any batch.

    Args:
        p: Believed chance of each cell to burn, float32 [B, G, H, W].
        burns: y, cells that burn, bool [B, H, W].
    """
    error = ((p - burns[:, None].to(torch.float32)).square() * _ERRORS).round().to(torch.int32).sum((1, 2, 3))
    count = burns.sum((1, 2))
    return torch.where(count > 0, 1.0 - error / (_ERRORS * p.shape[1] * count.clamp(min=1)), 0.0)


def metrics_of(beliefs: Beliefs, unknown: Sequence[tuple[str, int]]) -> dict[str, Tensor]:
    """Return metrics by name, float32 [B].

    ``jaccard``: cells that burn and are believed to, over those of which either holds, sums over the steps. ``skill``:
    mean of ``brier_skill`` over the steps in which something burns; no less than 0. ``rate_known``,
    ``wind_speed_known``, ``bearing_known``: 1 where the true value lies within the particles' 5 to 95 % quantiles now.
    ``rate_doubt`` and so on: their standard deviation over that before anything was seen.

    Args:
        beliefs: What is believed.
        unknown: Name and index of each parameter that the team does not know.
    """
    found = {
        "jaccard": beliefs.overlap / beliefs.union.clamp(min=1),
        "skill": (beliefs.skills / beliefs.alight.clamp(min=1)).clamp(0.0, 1.0),
    }
    known, groups = beliefs.learning, beliefs.weights.shape[1]
    if known is None:
        return found
    values, weights = known.particles.flatten(0, 1), known.weights.flatten(0, 1)
    _, covariance = moments(values, weights)
    deviation = covariance.diagonal(dim1=1, dim2=2).clamp(min=0.0).sqrt().unflatten(0, (-1, groups)).mean(1)
    for name, index in unknown:
        low, high = quantiles(values[..., index], weights, values.new_tensor([0.05, 0.95])).unbind(1)
        inside = ((low <= 0.0) & (high >= 0.0)).to(torch.float32).view(-1, groups)
        found[f"{name}_known"] = inside.mean(dim=1)
        found[f"{name}_doubt"] = (deviation[:, index] / known.prior[:, index]).clamp(max=1.0)
    return found
