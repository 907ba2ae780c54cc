"""Fires that embers start ahead of fires without vehicles; see ``world.behaviour.firebrands``."""

import math
from collections.abc import Callable
from dataclasses import dataclass
from functools import cached_property

import torch
from torch import Tensor

from warp_torchrl.world.arrays.random import Stream, named_key, uniform_among
from warp_torchrl.world.backends.growing import Caught
from warp_torchrl.world.backends.spreading import chosen
from warp_torchrl.world.behaviour.firebrands import FLIGHT, LANDING, Firebrands, Plume
from warp_torchrl.world.behaviour.moistures import fine_moisture
from warp_torchrl.world.fires.smouldering import Smouldering
from warp_torchrl.world.law.passing import HeadBehaviour, passing
from warp_torchrl.world.state.window import COLUMNS, Window

_HEAD = 4  # planes of heads that are read: rate, that of the rear, intensity and flame length
_TOGETHER = 2048  # cells whose firebrands fly in one computation, about
_SPARE = 0.01  # minutes, over the rounding of times


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

    The draws of a cell are those of its fire and its place on the map: the same in any window, batch and tick. So cells
    of several ticks throw their firebrands together, before the first of these can start a fire.

    Args:
        brands: The firebrands.
        ground: What they fly over.
        key: Of the fires, int64 [B].
    """

    def __init__(self, brands: Firebrands, ground: EmberGround, key: Tensor) -> None:
        self._brands, self._ground, self._fires = brands, ground, len(key)
        self._keys = {name: named_key(key, name) for name in (*FLIGHT, LANDING)}
        self._smouldering = Smouldering()
        self._caught: list[Caught] = []
        self._number, self._first = 0, math.inf  # of their spell; when the first of them caught fire
        self._air: tuple[int, Window, tuple[Tensor, Tensor]] | None = None

    @property
    def smoulder(self) -> bool:
        """Return whether any smoulders."""
        self._throw()
        return bool(len(self._smouldering))

    def due(self, end: float) -> tuple[Tensor, Tensor, Tensor]:
        """Return the fires that start until a time: of which fire, in which cell of the map, and when, [n] each."""
        if self._first + self._brands.delay <= end + _SPARE:
            self._throw()
        return self._smouldering.due(end)

    def thrown(self, number: int, caught: Caught) -> None:
        """Let cells that have caught fire in a spell throw firebrands, and keep those that ignite something."""
        if not caught.count:
            return
        if self._caught and (self._number, self._caught[0].window) != (number, caught.window):
            self._throw()
        self._caught.append(caught)
        self._number, self._first = number, min(self._first, float(caught.minutes.min()))
        if sum(each.count for each in self._caught) >= _TOGETHER:
            self._throw()

    def _throw(self) -> None:
        """Let all cells that wait for it throw their firebrands."""
        if not self._caught:
            return
        caught, self._caught, self._first = Caught.joined(self._caught), [], math.inf
        caught = caught.filled(COLUMNS)
        number = self._plume(self._number, caught).number[: caught.count]
        (throws,) = chosen(number > 0.0, torch.arange(caught.count))
        if len(throws):
            self._fly(caught.some(throws).filled(COLUMNS))

    def _fly(self, caught: Caught) -> None:
        """Let firebrands fly from cells that all throw some."""
        plume, moisture = self._plume(self._number, caught), self._moisture(self._number, caught)
        each = self._brands.followed
        index = (caught.cell[:, None] * each + torch.arange(each)).to(torch.int32)
        draws = (self._draws(name, caught.fire, index) for name in FLIGHT)
        flight, size = self._brands.flown(plume, *draws), self._ground.cell_size
        height, width = caught.window.map
        row = (caught.cell // width)[:, None] - (flight.north / size).clamp(-height, height).round().to(torch.int64)
        column = (caught.cell % width)[:, None] + (flight.east / size).clamp(-width, width).round().to(torch.int64)
        on_map = (row >= 0) & (row < height) & (column >= 0) & (column < width)
        landed = row.clamp(0, height - 1) * width + column.clamp(0, width - 1)
        burns = on_map & self._fuel.index_select(0, landed.flatten()).view_as(landed) & (landed != caught.cell[:, None])
        chance = -torch.expm1(-flight.number * self._brands.ignition(moisture)[:, None]) * burns
        lands = self._draws(LANDING, caught.fire, index) < chance
        which, brand = lands[: caught.count].nonzero(as_tuple=True)
        minutes = caught.minutes + self._brands.minutes(plume)
        self._smouldering.add(caught.fire[which], landed[which, brand], minutes[which])

    @cached_property
    def _fuel(self) -> Tensor:
        return self._ground.fuel.flatten()

    def _plume(self, number: int, caught: Caught) -> Plume:
        group, place = self._place(caught)
        heads = self._ground.heads(number, caught.window)[:, :_HEAD].flatten(2)
        at = group * heads.shape[2] + place
        then = HeadBehaviour(*(plane.flatten().index_select(0, at) for plane in heads.unbind(1)))
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
        return caught.fire // max(1, self._fires // groups), place

    def _air_in(self, number: int, window: Window) -> tuple[Tensor, Tensor]:
        """Return wind and moisture in a spell and a window, kept for the next tick."""
        if self._air is None or self._air[:2] != (number, window):
            self._air = number, window, self._ground.air(number, window)
        return self._air[2]

    def _draws(self, name: str, fire: Tensor, index: Tensor) -> Tensor:
        """Return uniform draws of some cells' firebrands, float32 [n, M]."""
        return uniform_among(self._keys[name], 0, Stream.NAMED, fire, index)
