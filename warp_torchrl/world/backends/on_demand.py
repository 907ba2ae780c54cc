"""Law ``rate`` in a wind that changes with every tick: its terms on demand.

Within a tick the fire needs the terms of a few cells in a hundred, of some of them many times.
"""

from dataclasses import dataclass

import torch
from torch import Tensor
from torch.nn.functional import pad

from warp_torchrl.world.arrays.listing import filled
from warp_torchrl.world.law.arrivals import Terms, terms_of
from warp_torchrl.world.law.rate import RateFire
from warp_torchrl.world.law.travel import travel
from warp_torchrl.world.state.state import Air, Ground


@dataclass(eq=False, repr=False)
class OnDemand(Terms):
    """Terms of a cell, made at the first demand and then kept."""

    fire: RateFire
    made: Tensor  # float32 [B,3,H,W], of the known cells; 0 elsewhere
    known: Tensor  # bool [B,H,W], cells whose terms are made

    def on(self, ground: Ground, air: Air) -> Tensor:
        """See ``Terms``."""
        if bool(self.known.all()):
            return self.made
        whole = self.fire.air(air.wind, air.moisture, ground)
        made = terms_of(whole).on(ground, whole)
        if self._is_open:
            self.made.copy_(made)
            self.known.fill_(True)
        return made

    def at(self, ground: Ground, air: Air, cell: Tensor) -> Tensor:
        """See ``Terms``."""
        count = self.known[0].numel()
        planes, known = self.made.view(-1), self.known.view(-1)
        places = cell + 2 * count * cell.div(count, rounding_mode="floor")
        new = (~known.index_select(0, cell)).nonzero()[:, 0]
        if len(new) and not self._is_open:
            return self._make(ground, air, cell)
        if len(new):
            made = self._make(ground, air, cell.index_select(0, new))
            for part in range(3):
                planes.index_copy_(0, places.index_select(0, new) + part * count, made[part])
            known.index_fill_(0, cell.index_select(0, new), True)
        return torch.stack([planes.index_select(0, places + part * count) for part in range(3)])

    @property
    def _is_open(self) -> bool:
        """Return whether terms can be kept; outside of inference mode, tensors that were made in it are closed."""
        return torch.is_inference_mode_enabled() or not self.made.is_inference()

    def _make(self, ground: Ground, air: Air, cell: Tensor) -> Tensor:
        spread = self.fire.spread_at(ground, air, pad(cell, (0, filled(len(cell)) - len(cell))))
        made = travel(spread.head, spread.direction, spread.length_to_breadth, ground.cell_size)
        return made[0, :, 0, : len(cell)]


def on_demand(fire: RateFire, wind: Tensor, moisture: Tensor | None, ground: Ground) -> Air:
    """Return a wind with its terms on demand; the arguments are those of ``Automaton.air``."""
    air, shape = Air(wind, moisture), ground.alpha.shape
    made = torch.zeros(shape[0], 3, *shape[1:], device=wind.device)
    known = torch.zeros(shape, dtype=torch.bool, device=wind.device)
    return air.replace(terms=OnDemand(fire.beds_in(air), fire, made, known))
