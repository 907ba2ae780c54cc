"""Fires that embers start ahead of fires without vehicles; see ``world.behaviour.firebrands``."""

from collections.abc import Callable
from dataclasses import dataclass

import torch
from torch import Tensor

from warp_torchrl.world.arrays.random import Stream, named_key, uniform_among
from warp_torchrl.world.backends.growing import Caught
from warp_torchrl.world.behaviour.firebrands import FLIGHT, LANDING, Firebrands, Plume
from warp_torchrl.world.behaviour.moistures import fine_moisture
from warp_torchrl.world.law.passing import HeadBehaviour, passing
from warp_torchrl.world.state.window import COLUMNS, Window

_HEAD = 4  # planes of heads that are read: rate, that of the rear, intensity and flame length


@dataclass(frozen=True, kw_only=True, eq=False)
class EmberGround:
    """What firebrands fly over, of some groups of fires on one map."""

    fuel: Tensor  # cells that can ignite, bool [H, W]
    heads: Callable[[int, Window], Tensor]  # behaviour of heads in a spell and a window, float32 [G, 4 or more, h, w]
    air: Callable[[int, Window], tuple[Tensor, Tensor]]  # wind [G, 2, ...] and moisture [G, 7] or [G, h, w, 7] there
    groups: int  # G
    by_code: bool  # whether moisture is told by the Canadian code
    cell_size: float  # side of a cell [m]


class SpotFires:
    """Embers of some fires that smoulder until they start fires.

    The draws of a cell are those of its fire and its place on the map: the same in any window, batch and tick.

    Args:
        brands: The firebrands.
        ground: What they fly over.
        key: Of the fires, int64 [B].
    """

    def __init__(self, brands: Firebrands, ground: EmberGround, key: Tensor) -> None:
        self._brands, self._ground, self._key = brands, ground, key
        self._fire = self._cell = torch.zeros(0, dtype=torch.int64)
        self._minutes = torch.zeros(0)
        self._air: tuple[int, Window, tuple[Tensor, Tensor]] | None = None

    @property
    def smoulder(self) -> bool:
        """Return whether any smoulders."""
        return bool(len(self._cell))

    def due(self, end: float) -> tuple[Tensor, Tensor, Tensor]:
        """Return the fires that start until a time: of which fire, in which cell of the map, and when, [n] each."""
        now = self._minutes <= end
        found = self._fire[now], self._cell[now], self._minutes[now]
        self._fire, self._cell, self._minutes = self._fire[~now], self._cell[~now], self._minutes[~now]
        return found

    def thrown(self, number: int, caught: Caught) -> None:
        """Let cells that have caught fire in a spell throw firebrands, and keep those that ignite something."""
        caught = caught.filled(COLUMNS)
        if not len(caught.minutes):
            return
        plume = self._plume(number, caught)
        throws = plume.number > 0.0
        if not bool(throws.any()):
            return
        moisture = self._moisture(number, caught)
        each = self._brands.followed
        index = caught.cell[:, None] * each + torch.arange(each)
        draws = (self._draws(name, caught.fire, index) for name in FLIGHT)
        flight, size = self._brands.flown(plume, *draws), self._ground.cell_size
        height, width = caught.window.map
        row = (caught.cell // width)[:, None] - (flight.north / size).clamp(-height, height).round().to(torch.int64)
        column = (caught.cell % width)[:, None] + (flight.east / size).clamp(-width, width).round().to(torch.int64)
        on_map = (row >= 0) & (row < height) & (column >= 0) & (column < width)
        landed = row.clamp(0, height - 1) * width + column.clamp(0, width - 1)
        burns = on_map & self._ground.fuel.flatten()[landed] & (landed != caught.cell[:, None])
        chance = -torch.expm1(-flight.number * self._brands.ignition(moisture)[:, None]) * burns * throws[:, None]
        which, brand = (self._draws(LANDING, caught.fire, index) < chance).nonzero(as_tuple=True)
        new = which < caught.count
        which, brand = which[new], brand[new]
        self._fire = torch.cat((self._fire, caught.fire[which]))
        self._cell = torch.cat((self._cell, landed[which, brand]))
        self._minutes = torch.cat((self._minutes, (caught.minutes + self._brands.minutes(plume))[which]))

    def _plume(self, number: int, caught: Caught) -> Plume:
        group, place = self._place(caught)
        heads = self._ground.heads(number, caught.window)[:, :_HEAD].flatten(2)
        then = HeadBehaviour(*heads[group, :, place].unbind(1))
        rate, intensity, flame_length = passing(caught.steep, caught.pace, then, self._ground.cell_size)
        wind = self._air_in(number, caught.window)[0].flatten(2)
        east, north = wind[group, :, place if wind.shape[2] > 1 else torch.zeros_like(place)].unbind(1)
        brands = self._brands.number(intensity, rate, self._ground.cell_size**2)
        return Plume(intensity, flame_length, brands, east, north)

    def _moisture(self, number: int, caught: Caught) -> Tensor:
        """Return the moisture of fine dead fuel where firebrands rise, float32 [n] [%]."""
        group, place = self._place(caught)
        moisture = fine_moisture(self._air_in(number, caught.window)[1], self._ground.by_code)
        return moisture[group] if moisture.dim() == 1 else moisture.flatten(1)[group, place]

    def _place(self, caught: Caught) -> tuple[Tensor, Tensor]:
        """Return the group of each cell and its flat index in the window, int64 [n] each."""
        window, width = caught.window, caught.window.map[1]
        groups = self._ground.groups
        place = (caught.cell // width - window.top) * window.width + caught.cell % width - window.left
        return caught.fire // max(1, len(self._key) // groups), place

    def _air_in(self, number: int, window: Window) -> tuple[Tensor, Tensor]:
        """Return wind and moisture in a spell and a window, kept for the next tick."""
        if self._air is None or self._air[:2] != (number, window):
            self._air = number, window, self._ground.air(number, window)
        return self._air[2]

    def _draws(self, name: str, fire: Tensor, index: Tensor) -> Tensor:
        """Return uniform draws of some cells' firebrands, float32 [n, M]."""
        each = index.shape[1]
        found = uniform_among(
            named_key(self._key, name), 0, Stream.NAMED, fire.repeat_interleave(each), index.flatten().to(torch.int32)
        )
        return found.view(index.shape)
