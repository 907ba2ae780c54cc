"""Flames that reach over a firebreak, by its width and their length (Wilson 1988; ``world.behaviour.firebreaks``)."""

from dataclasses import dataclass

import torch
from torch import Tensor

from warp_torchrl.validation import check_fields
from warp_torchrl.world.arrays.batch import Batch
from warp_torchrl.world.arrays.geometry import grow, neighbour_in
from warp_torchrl.world.arrays.listing import filled
from warp_torchrl.world.arrays.random import Stream, named_key, uniform
from warp_torchrl.world.arrays.shortlist import first_cells
from warp_torchrl.world.backends.backend import advance_rows
from warp_torchrl.world.backends.fronts import fronts
from warp_torchrl.world.behaviour.firebreaks import holds_up_to, intensity_of
from warp_torchrl.world.ignition.intervention import ignited
from warp_torchrl.world.law.automaton import Automaton
from warp_torchrl.world.law.rate import RateFire
from warp_torchrl.world.mechanics.mechanic import Mechanic, Metric, Rules
from warp_torchrl.world.mechanics.table import mechanic
from warp_torchrl.world.state.state import Cover, WorldState

_SHARE = 8
"""One in so many cells of a map burns beside a firebreak and is measured in a tick at most."""


@dataclass(eq=False, repr=False)
class Breaches(Batch):
    """Firebreaks that flames reached over."""

    count: Tensor  # int32 [B], cells beyond them that caught fire so


@mechanic("breach")
@dataclass(frozen=True, kw_only=True)
class Breach(Mechanic):
    """Firebreaks of one cell, which the team cleared, that flames may reach over.

    Each cell of a firebreak holds flames up to a strength that is drawn once an episode. Under law ``rate`` the flames
    are those of the front as it came to the cell beside it; the other laws have one length of flames.

    Attributes:
        width: Of a firebreak [m]; None: the side of a cell. Where mechanic ``lines`` builds them, each has the width of
            who finished it.
        flame_length: Of flames under laws other than ``rate`` [m].

    Raises:
        ValueError: If a value is out of its range.
    """

    width: float | None = 5.0
    flame_length: float = 3.0

    def __post_init__(self) -> None:
        check_fields(self, width=(0.5, 1000.0), flame_length=(0.1, 100.0))

    def check(self, world: Rules) -> None:
        """Check that a length of flames is given where it is read.

        Raises:
            ValueError: If not.
        """
        if isinstance(world.fire, RateFire) and self.flame_length != Breach().flame_length:
            raise ValueError(
                "mechanics.breach.flame_length is read under other laws than rate alone, got it under rate"
            )

    def begin(self, state: WorldState, world: Rules) -> WorldState:
        """Return worlds in which no firebreak was breached."""
        return state.with_planes(self.name, Breaches(torch.zeros_like(state.step)))

    def after_tick(self, state: WorldState, ticks_now: Tensor, world: Rules) -> WorldState:
        """Return worlds in which fire reached over firebreaks, in those that ticked."""
        beside = (world.fire.spreads(state) & grow(state.firebreak)).flatten(1).any(dim=1)
        return advance_rows(state, ticks_now & beside, lambda rows, ticks: self._reach(rows, ticks, world.fire))

    def metric_rows(self, world: Rules) -> tuple[Metric, ...]:
        """Return ``breaches``."""
        return (Metric("breaches", "less"),)

    def metrics(self, state: WorldState) -> dict[str, Tensor]:
        """Return ``breaches``, the cells beyond firebreaks that flames have ignited, a share of the map's."""
        return {"breaches": state.planes(self.name, Breaches).count / state.cells[0].numel()}

    def _reach(self, state: WorldState, ticks_now: Tensor, fire: Automaton) -> WorldState:
        size, trees = state.ground.cell_size, state.cover == int(Cover.FOREST)
        draw = uniform(named_key(state.key, self.name), 0, Stream.NAMED, (state.cells.shape[1], state.cells.shape[2]))
        among_trees, in_open = (holds_up_to(draw, self._widths(state), each, size) for each in (True, False))
        intensity = self._intensity(state, fire)
        burns, lit = intensity > -torch.inf, torch.zeros_like(trees)
        for direction in range(8):  # fire comes from the cell behind a firebreak's, and goes to the one before it
            behind = (direction + 4) % 8
            held = torch.where(neighbour_in(behind, trees), among_trees, in_open)
            breached = state.firebreak & neighbour_in(behind, burns) & (neighbour_in(behind, intensity) > held)
            lit = lit | neighbour_in(behind, breached)
        after = ignited(state, fire, lit & ticks_now[:, None, None])
        new = (after.cells != state.cells).flatten(1).sum(dim=1, dtype=torch.int32)
        return after.with_planes(self.name, Breaches(state.planes(self.name, Breaches).count + new))

    def _widths(self, state: WorldState) -> Tensor:
        """Return the widths of firebreaks, float32 [B, H, W] [m]; anything elsewhere."""
        width = torch.full_like(state.alpha, state.ground.cell_size if self.width is None else self.width)
        built = state.plane("lines", "work")
        return width if built is None else torch.where(built > 0, built * 0.1, width)

    def _intensity(self, state: WorldState, fire: Automaton) -> Tensor:
        """Return the intensity of fire in each burning cell beside a firebreak, float32 [B, H, W] [kW/m]; else -inf."""
        burns = fire.spreads(state) & grow(state.firebreak)
        none = torch.full_like(state.alpha, -torch.inf)
        if not isinstance(fire, RateFire):
            return torch.where(burns, intensity_of(self.flame_length), none)
        cell, is_there = first_cells(burns, filled(state.cells[0].numel() // _SHARE))
        found = torch.where(is_there, fronts(fire, state, cell, is_there).intensity, -torch.inf)
        return none.flatten(1).scatter_reduce(1, cell, found, "amax").view_as(none)
