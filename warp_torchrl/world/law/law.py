"""The law of the fire: one tick of the automaton, in plain tensor operations on whole maps.

A tick is synchronous: all of it reads the worlds before the tick. B worlds, H rows, W columns. Fire travels in a
direction d from the source, which burns, to the target, a tree (``geometry.DIRECTIONS``). Rules are of the report
WARP-CA (arXiv 2407.02613) where no other source is named. ``warp_torchrl.world.backends`` computes the same faster.
"""

import math
from dataclasses import dataclass

import torch
from torch import Tensor

from warp_torchrl.world.arrays.geometry import neighbour_in
from warp_torchrl.world.law.cells import is_burning
from warp_torchrl.world.state.state import EMBER, FIRST_FIRE, OLDEST, WorldState

LARGEST_ALPHA = 0.95
"""Flammability from which law ``hazard`` grows no more: at 1 its hazard would have no bound."""


@dataclass(frozen=True)
class Clipped:
    """Law ``paper``: p_d = clip(f_d, 0, 1) with f_d = alpha w_d s_d / distance_d, and q = 1 - prod_d (1 - p_d).

    Another law is a subclass that redefines what differs.
    """

    def susceptibility(self, alpha: Tensor) -> Tensor:
        """Return the target's factor in the strength f_d, here alpha."""
        return alpha

    def join(self, total: Tensor, strength: Tensor) -> Tensor:
        """Return the total q joined with one more strength, p_d + q (1 - p_d): 0, 1 and small numbers stay exact."""
        p = strength.clamp(max=1.0)
        return p + total * (1.0 - p)

    def probability(self, total: Tensor) -> Tensor:
        """Return the probability to ignite of a total, here the total itself."""
        return total


@dataclass(frozen=True)
class Hazard(Clipped):
    """Law ``hazard``: p_d = 1 - exp(-h_d), and q = 1 - exp(-sum_d h_d).

        h_d = -ln(1 - min(alpha, 0.95)) / k w_d s_d / distance_d

    A neighbour that burns for F stages of k ticks ignites the tree with probability 1 - (1 - alpha)^F, as under law
    ``paper``.
    """

    refinement: int  # k, ticks to one of the paper's

    def susceptibility(self, alpha: Tensor) -> Tensor:
        """Return -ln(1 - min(alpha, 0.95)) / k."""
        return torch.log1p(-alpha.clamp(max=LARGEST_ALPHA)) * (-1.0 / self.refinement)

    def join(self, total: Tensor, strength: Tensor) -> Tensor:
        """Return the sum of the hazards."""
        return total + strength

    def probability(self, total: Tensor) -> Tensor:
        """Return 1 - exp(-total)."""
        return -torch.expm1(-total)


def spread_probability(
    law: Clipped, burns: Tensor, susceptible: Tensor, gain: Tensor, slope: Tensor | None, directions: range
) -> Tensor:
    """Return each tree's probability to be ignited by its neighbours in one tick, float32 [B, H, W].

    Args:
        law: How strengths make a probability.
        burns: 1 in cells that spread fire, else 0, float32 [B, H, W].
        susceptible: The law's susceptibility of trees that can ignite, else 0, float32 [B, H, W].
        gain: w_d / distance_d at the source, float32 [B, 8, 1, 1] or [B, 8, H, W].
        slope: s_d into the target, float32 [B, 8, H, W]; None where the ground is flat.
        directions: Those in which fire travels.
    """
    total = torch.zeros_like(susceptible)
    for d in directions:
        strength = neighbour_in((d + 4) % 8, burns * gain[:, d]) * susceptible
        total = law.join(total, strength if slope is None else strength * slope[:, d])
    return law.probability(total)


def expected_ignitions(
    law: Clipped, susceptible: Tensor, gain: Tensor, slope: Tensor | None, directions: range
) -> Tensor:
    """Return how many neighbours each cell is expected to ignite in one tick if it burned, float32 [B, H, W].

    The arguments are those of ``spread_probability``.
    """
    total = torch.zeros_like(susceptible)
    for d in directions:
        strength = neighbour_in(d, susceptible) * gain[:, d]
        strength = strength if slope is None else strength * neighbour_in(d, slope[:, d])
        total = total + law.probability(law.join(torch.zeros_like(total), strength))
    return total


def growth_probability(age: int, tau: float, oldest: int = OLDEST) -> float:
    """Return p_grow = exp(-age / S_max tau) of a tree of age 1 and more; the oldest, S_max, grow no more."""
    return math.exp(-age / oldest * tau) if 1 <= age < oldest else 0.0


def lightning_probability(age: int, beta: float, cells: int, oldest: int = OLDEST) -> float:
    """Return p_spont = beta exp(10 age / S_max - 10) / (H W) of a tree on a map of H W cells."""
    return min(1.0, beta * math.exp(10.0 * age / oldest - 10.0) / cells) if 1 <= age <= oldest else 0.0


def in_finer_time(probability: float, ticks: int) -> float:
    """Return the probability in each of so many ticks of what has this one in all of them together."""
    return probability if ticks == 1 or probability == 1.0 else -math.expm1(math.log1p(-probability) / ticks)


def tick(
    state: WorldState, u: Tensor, ticks_now: Tensor, q: Tensor, grow: Tensor, regrow: Tensor, stage: int
) -> WorldState:
    """Return the worlds after one tick, in those that tick now: trees ignite, grow and regrow, fires age and burn out.

    One uniform draw a cell serves all, since the three exclude each other: a tree ignites where u < q, else it grows
    where u >= 1 - (1 - q) p_grow, and empty ground grows a tree of age 1 where u < p_regrow.

    Args:
        state: The worlds before the tick.
        u: float32 [B, H, W] in [0, 1).
        ticks_now: Which worlds tick, bool [B].
        q: Probability to ignite, float32 [B, H, W].
        grow: p_grow of each cell, float32 [B, H, W]; 0 where no tree grows.
        regrow: p_regrow of each cell, float32 [B, H, W]; 0 where nothing grows anew.
        stage: Ticks that a burning stage lasts.
    """
    here, cells, burning = ticks_now[:, None, None], state.cells, is_burning(state.cells)
    waited = torch.zeros_like(cells) if state.stage_age is None else state.stage_age
    ignites, grows, regrows = here & (u < q), here & (u >= 1.0 - grow * (1.0 - q)), here & (u < regrow)
    stage_ends = here & burning & (waited + 1 == stage)
    burns_out = stage_ends & (cells == EMBER)
    after = torch.where(stage_ends | grows, cells + 1, cells)
    after = torch.where(regrows, 1, torch.where(burns_out, 0, torch.where(ignites, FIRST_FIRE, after)))
    waited = torch.where(ignites | stage_ends, 0, torch.where(here & burning, waited + 1, waited))
    return state.replace(
        cells=after.to(torch.uint8),
        age=torch.where(ignites, cells, torch.where(burns_out, 0, state.age)).to(torch.uint8),
        stage_age=None if state.stage_age is None else waited.to(torch.uint8),
        burned=state.burned | burns_out,
        wet=torch.where(here & (state.wet > 0), state.wet - 1, state.wet),
        tick=state.tick + ticks_now,
    )
