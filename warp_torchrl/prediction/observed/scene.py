"""A fire and its weather, and what its members reach between two times."""

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from typing import Protocol, TypeVar

import torch
from torch import Tensor

from warp_torchrl.world.air.weather import Weather
from warp_torchrl.world.fires.alone import Burned
from warp_torchrl.world.fires.arrival_minutes import on_map
from warp_torchrl.world.fires.members import Members
from warp_torchrl.world.fires.pieces import Gusts
from warp_torchrl.world.fires.sightings import beside
from warp_torchrl.world.fires.spell import Spell, can_ignite, spells_of
from warp_torchrl.world.law.rate import RateFire
from warp_torchrl.world.law.travel import NEVER
from warp_torchrl.world.state.state import Landscape

T = TypeVar("T", covariant=True)


class Reduction(Protocol[T]):
    """What is kept of some members' arrivals."""

    def __call__(self, arrival: Tensor, members: Members) -> T:
        """Return it, of float32 [k, H, W] [minutes], as if no sector was held, and the k members."""


@dataclass(frozen=True, kw_only=True, eq=False)
class Scene:
    """A fire and its weather.

    Attributes:
        ground: The map, batch size [1].
        cell_size: Side of a cell [m].
        fire: The law; its ``fire_deviation`` is not read, for members have rates of their own.
        air: The weather.
        start: When the fires start, since the weather's first row began [minutes].
        lit: Where they start, bool [H, W].
        gusts: How members draw their winds about the mean; None: they have the mean wind.
    """

    ground: Landscape
    cell_size: float
    fire: RateFire
    air: Weather
    start: float
    lit: Tensor
    gusts: Gusts | None = None

    @cached_property
    def law(self) -> RateFire:
        """Return the law without what members have."""
        return self.fire.alike()

    @cached_property
    def fuel(self) -> Tensor:
        """Return the cells that can ignite, bool [H, W]."""
        return can_ignite(self.law, self.ground)

    def spells(self, begin: float, end: float) -> list[Spell]:
        """Return the weather between two times since the start [minutes], of the mean wind."""
        return spells_of(self.air, end - begin, self.start + begin)

    def gusting(self, members: Members, key: Tensor) -> Members:
        """Return members that draw their winds by keys, int64 [K], where there are gusts."""
        return members if self.gusts is None else replace(members, gusts=key)

    def edge(self, known: Tensor) -> Tensor:
        """Return the cells along the front of what has burned that can burn, bool [H, W]."""
        return beside(known) & self.fuel

    def burned(
        self, members: Members, key: Tensor, lit: Tensor, period: tuple[float, float], keep: Reduction[T]
    ) -> list[T]:
        """Return what is kept of the members' arrivals [minutes since they began], part by part.

        Args:
            members: The K members.
            key: Of their draws, int64 [K].
            lit: What burns or has burned when they begin, bool [H, W].
            period: When they begin and end [minutes since the fire's start].
            keep: What is kept; never are the arrivals of more than a part of the members held.
        """
        begin, end = period
        if not bool((lit & self.fuel).any()):
            none = torch.full((len(members), *lit.shape), NEVER)
            none[:, lit] = 0.0
            return [keep(none, members)]
        half_way = beside(lit) if begin > 0.0 else None
        spells = self.spells(begin, end)
        if self.gusts is not None and members.gusts is not None:
            spells = self.gusts.blocks(spells, math.ceil(begin))  # a draw is a minute long at least
        fires = members.open.fires(self.law, self.ground, spells, self.cell_size, half_way)

        def reached(part: Burned) -> Tensor:
            found = on_map(part)
            found[:, lit] = 0.0
            return found

        made: list[T] = []
        first = 0
        for arrival in fires.in_parts(lit & self.fuel, key, reached):
            made.append(keep(arrival, members.part(slice(first, first + len(arrival)))))
            first += len(arrival)
        return made


@dataclass(frozen=True, eq=False)
class InSteps:
    """Keeps the first of some times by which each member had come.

    Attributes:
        times: Since the members began, increasing [minutes].
    """

    times: Sequence[float]

    def __call__(self, arrival: Tensor, members: Members) -> Tensor:
        """Return its place, int16 [k, H, W]; the number of the times where a member comes by none of them."""
        return torch.bucketize(members.stopped(arrival), torch.tensor(self.times), out_int32=True).to(torch.int16)


@dataclass(frozen=True, eq=False)
class ByTimes:
    """Counts the members that had come by some times.

    Attributes:
        times: Since the members began [minutes].
    """

    times: Sequence[float]

    def __call__(self, arrival: Tensor, members: Members) -> Tensor:
        """Return the counts, float32 [S, H, W]."""
        arrival = members.stopped(arrival)
        return torch.stack([(arrival <= time).sum(0, dtype=torch.float32) for time in self.times])
