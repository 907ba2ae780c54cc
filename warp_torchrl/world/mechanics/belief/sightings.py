"""The cells that beliefs learn of in a step, as a list, so that what follows grows with them and not with the map."""

from typing import NamedTuple

import torch
from torch import Tensor

from warp_torchrl.world.arrays.listing import list_cells
from warp_torchrl.world.mechanics.mechanic import Rules
from warp_torchrl.world.state.records import read, recorded
from warp_torchrl.world.state.state import FIRST_FIRE, WorldState


class Sightings(NamedTuple):
    """What n cells were taken for, of each of G beliefs of B worlds, [B, G, n] each."""

    cell: Tensor  # int64, flat; of padding that of the first cell
    there: Tensor  # bool, False of padding
    first: Tensor  # bool, seen for the first time since the last tick of the fire
    code: Tensor  # uint8
    ash: Tensor  # bool
    cleared: Tensor  # bool

    @property
    def burns(self) -> Tensor:
        """Return which were taken to burn, bool [B, G, n]."""
        return self.code >= FIRST_FIRE

    @property
    def is_new(self) -> Tensor:
        """Return which of these cells are to be written, bool [B, G, n]: padding repeats the first cell."""
        return self.there | self.there[..., :1]

    def in_worlds(self, rows: Tensor) -> "Sightings":
        """Return those of some worlds, int64 [n]."""
        return Sightings(*(each.index_select(0, rows) for each in self))

    def of(self, planes: Tensor) -> Tensor:
        """Return what planes [B, G or 1, K, H, W] hold there, [B, G, K, n]."""
        flat = planes.flatten(3)
        index = self.cell[:, :, None].expand(-1, -1, flat.shape[2], -1)
        return flat.expand(-1, index.shape[1], -1, -1).gather(3, index)

    def put(self, planes: Tensor, values: Tensor) -> Tensor:
        """Return planes [B, G, K, H, W] with values [B, G, K, n] there; what is not there must have its old value."""
        index = self.cell[:, :, None].expand(-1, -1, planes.shape[2], -1)
        return planes.flatten(3).scatter(3, index, values.to(planes.dtype)).view_as(planes)


def since_tick(state: WorldState, world: Rules) -> Tensor:
    """Return the least record of what was seen since the last tick of the fire, int32 [B]."""
    ticked_at = state.step - state.step % world.steps_per_tick
    return recorded(torch.zeros_like(ticked_at), ticked_at)


def newest(records: Tensor, groups: int) -> Tensor:
    """Return the newest records of each of G beliefs, int32 [B, G, H, W]: the team's, or those of each agent.

    Args:
        records: Of the agents, int32 [B, A, H, W].
        groups: G, 1 or A.
    """
    return records.amax(dim=1, keepdim=True) if groups == 1 else records


def sightings(before: Tensor, records: Tensor, running: Tensor, since_tick: Tensor) -> Sightings:
    """Return the cells whose records are newer than before, in the worlds that go on.

    Args:
        before: Records before a step, int32 [B, G, H, W].
        records: After it.
        running: Worlds that go on, bool [B].
        since_tick: Records of the step of the last tick are at least this, int32 [B].
    """
    groups = records.shape[:2]
    new = (records > before) & running[:, None, None, None]
    index, there = (each.unflatten(0, groups) for each in list_cells(new.flatten(0, 1)))
    index = torch.where(there, index, index[..., :1])
    old = before.flatten(2).gather(2, index)
    return Sightings(
        index, there, there & (old < since_tick[:, None, None]), *read(records.flatten(2).gather(2, index))
    )
