"""The automaton of a forest on a lattice, whose trees burn for a time without memory."""

import math
from dataclasses import dataclass

import torch
from torch import Tensor

from warp_torchrl.validation import check_fields
from warp_torchrl.world.arrays.geometry import neighbour_in
from warp_torchrl.world.law.automaton import Automaton, Beside
from warp_torchrl.world.law.cells import holds_trees, is_burning
from warp_torchrl.world.state.state import FIRST_FIRE, Air, Ground, Landscape, WorldState

_FOUR = range(0, 8, 2)
"""Directions of the neighbours along the axes."""


@dataclass(frozen=True, kw_only=True)
class LatticeFire(Automaton):
    """Law ``lattice``: a tree is healthy, on fire or burnt, and forgets for how long it has burned.

        p(healthy -> on fire) = 1 - (1 - alpha)^k,   k of its four neighbours burn
        p(on fire -> burnt)   = 1 - (beta - delta_beta treated)

    (Haksar and Schwager, "Distributed Deep Reinforcement Learning for Fighting Forest Fires with a Network of Aerial
    Robots", IROS 2018; after Somanath, Karaman and Youcef-Toumi, CDC 2014. The numbers are those of the authors'
    public code.) A burning tree has the code of the first stage until it is burnt. It is treated where ``wet`` is not
    0: retardant acts on the next tick alone, and does not put a fire out (``world.mechanics.retardant``). Wind and
    slope have no effect.

    Attributes:
        alpha: Chance that one burning neighbour ignites a tree in a tick.
        persistence: beta, chance that a burning tree burns on in a tick.
        retardant: delta_beta, by how much the retardant lowers it.
        wet_ticks: Ticks for which a tree that was put out, by vehicles that can, cannot ignite.

    Raises:
        ValueError: If a value is out of its range, ``retardant`` is above ``persistence``, or ``burning_stages`` is
            not 1.
    """

    youngest_fuel: int = 1
    burning_stages: int = 1
    alpha: float = 0.2763
    persistence: float = math.exp(-0.1)
    retardant: float = 0.15 / 0.2763
    wet_ticks: int = 10

    def __post_init__(self) -> None:
        super().__post_init__()
        check_fields(
            self,
            burning_stages=(1, 1),
            alpha=(0.0, 1.0),
            persistence=(0.0, 1.0),
            retardant=(0.0, self.persistence),
            wet_ticks=(0, 255),
        )

    @property
    def wet_for(self) -> int:
        """Return the ticks for which a tree that was put out cannot ignite."""
        return self.wet_ticks

    def flammability(self, landscape: Landscape) -> Tensor:
        """Return alpha where a tree can stand, float32 [B, H, W]."""
        return holds_trees(landscape.cover) * self.alpha

    def ground(self, landscape: Landscape, cell_size: float, key: Tensor) -> Ground:
        """See ``Automaton``."""
        return Ground(landscape, self.flammability(landscape), cell_size=cell_size)

    def air(self, wind: Tensor, moisture: Tensor | None, ground: Ground) -> Air:
        """See ``Automaton``."""
        return Air(wind, moisture)

    def ignition_probability(self, state: WorldState) -> Tensor:
        """Return 1 - (1 - alpha)^k, joined with p_spont, float32 [B, H, W]; 0 where nothing can ignite."""
        burns = self.spreads(state).to(torch.float32)
        spared = torch.ones_like(burns)
        for direction in _FOUR:
            spared = spared * (1.0 - state.alpha * neighbour_in(direction, burns))
        spread = (1.0 - spared) * self.is_fuel(state)
        if self.beta == 0.0:
            return spread
        spontaneous = self.spontaneous(state)
        return spontaneous + (1.0 - spontaneous) * spread

    def expected_ignitions(self, state: WorldState) -> Tensor:
        """Return how many neighbours each burning cell is expected to ignite in one tick, float32 [B, H, W]; else 0."""
        chance = state.alpha * self.is_fuel(state)
        return sum((neighbour_in(direction, chance) for direction in _FOUR), torch.zeros_like(chance)) * self.spreads(
            state
        )

    def ignition_beside(self, state: WorldState, beside: Beside, rate: Tensor, air: Air) -> Tensor:
        """Return 1 - prod_d (1 - pi_d alpha), pi_d the chance of a source: see ``Automaton``."""
        alpha = self.faster(beside.of(state.alpha)[:, None], rate[..., None])
        spared = torch.ones_like(alpha)
        for direction in _FOUR:
            spared = spared * (1.0 - beside.spreads[:, None, direction] * alpha)
        return 1.0 - spared

    def burn_out_probability(self, state: WorldState) -> Tensor:
        """Return each burning tree's chance to be burnt after the next tick, float32 [B, H, W]; 0 elsewhere."""
        treated = state.wet > 0
        return (1.0 - self.persistence + self.retardant * treated) * is_burning(state.cells)

    def tick_with(self, state: WorldState, u: Tensor, ticks_now: Tensor, q: Tensor) -> WorldState:
        """Advance by one tick: trees ignite, and may grow, as under any law; a fire burns out by its chance.

        A cell's one draw serves both: no cell that can ignite burns.
        """
        burns = is_burning(state.cells)
        burns_out = ticks_now[:, None, None] & (u < self.burn_out_probability(state))
        after = super().tick_with(state, u, ticks_now, q)
        goes_on = burns & ~burns_out
        return after.replace(
            cells=torch.where(burns_out, 0, torch.where(goes_on, FIRST_FIRE, after.cells)).to(torch.uint8),
            age=torch.where(burns_out, 0, after.age).to(torch.uint8),
            burned=after.burned | burns_out,
        )
