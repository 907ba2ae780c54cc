"""Agreement of two sets of cells: those predicted to burn, A, and those that burned, S."""

import torch
from torch import Tensor

BURNS = 0.5
"""Least burn probability of a cell that is predicted to burn."""


def jaccard(burned: Tensor, scar: Tensor) -> Tensor:
    """Return |A and S| / |A or S| (Jaccard 1901), float32 [...]; 1 where both are empty.

    Args:
        burned: A, bool [..., H, W].
        scar: S, bool [..., H, W].
    """
    both, either = count(burned & scar), count(burned | scar)
    return torch.where(either > 0.0, both / either.clamp(min=1.0), 1.0)


def sorensen(burned: Tensor, scar: Tensor) -> Tensor:
    """Return 2 |A and S| / (|A| + |S|) (Sorensen 1948), the score F1, float32 [...]; 1 where both are empty."""
    both, total = count(burned & scar), count(burned) + count(scar)
    return torch.where(total > 0.0, 2.0 * both / total.clamp(min=1.0), 1.0)


def area_error(burned: Tensor, scar: Tensor) -> Tensor:
    """Return |A| / |S| - 1, float32 [...]."""
    return count(burned) / count(scar).clamp(min=1.0) - 1.0


def kappa(burned: Tensor, scar: Tensor) -> float:
    """Return Cohen's kappa of two sets of cells (Cohen 1960), (p_o - p_e) / (1 - p_e); 1 where both are all or none.

    Unlike the other scores it depends on the cells of the map that burned in neither.

    Args:
        burned: A, bool [H, W].
        scar: S, bool [H, W].
    """
    agreed = float((burned == scar).double().mean())
    one, other = float(burned.double().mean()), float(scar.double().mean())
    by_chance = one * other + (1.0 - one) * (1.0 - other)
    return 1.0 if by_chance == 1.0 else (agreed - by_chance) / (1.0 - by_chance)


def count(cells: Tensor) -> Tensor:
    """Return the number of cells, float32 [...], of bool [..., H, W]."""
    return cells.sum((-2, -1)).to(torch.float32)
