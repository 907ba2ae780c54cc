"""Embers that fall where the fire has not come to yet, and what they ignite.

Under law ``rate`` a cell throws firebrands as it catches fire (``world.behaviour.firebrands``). Their number follows
from the heat of the cell, their distance from the front's intensity and the wind. The other laws know no heat: each
burning tree throws a firebrand with some chance in a tick.
"""

from dataclasses import dataclass, field
from typing import ClassVar, NamedTuple

import torch
from torch import Tensor

from warp_torchrl.validation import check_fields
from warp_torchrl.world.arrays.batch import Batch
from warp_torchrl.world.arrays.listing import filled
from warp_torchrl.world.arrays.random import Stream, named_key, uniform, uniform_at
from warp_torchrl.world.arrays.shortlist import first_cells
from warp_torchrl.world.backends.backend import advance_rows
from warp_torchrl.world.backends.fronts import fronts
from warp_torchrl.world.behaviour.firebrands import FLIGHT, LANDING, Firebrands, Plume, lognormal, normal_of
from warp_torchrl.world.ignition.intervention import ignited
from warp_torchrl.world.law.automaton import Automaton, at_cells
from warp_torchrl.world.law.law import in_finer_time
from warp_torchrl.world.law.rate import RateFire
from warp_torchrl.world.mechanics.mechanic import Mechanic, Metric, Rules
from warp_torchrl.world.mechanics.table import mechanic
from warp_torchrl.world.state.cells import is_burning
from warp_torchrl.world.state.state import WorldState

_SHARE = 64
"""One in so many cells of a world throws in a tick at most. Others of law ``rate`` throw in the next one."""
_PARTS = 4096  # of a firebrand, so that sums are whole numbers and do not depend on their order
_MOST = 64.0  # firebrands that count for one cell
_NEVER = 1e9  # ticks


@dataclass(eq=False, repr=False)
class Fallen(Batch):
    """Embers that have fallen."""

    falls: Tensor  # uint8 [B,H,W], 255 times the chance that one glowed there in the last tick
    due: Tensor  # float32 [B,H,W], tick after which one that smoulders there starts a fire; 1e9: none does
    thrown: Tensor  # bool [B,H,W], burns and has thrown its firebrands, under law ``rate``
    spots: Tensor  # int32 [B], fires that embers have started


class _Landing(NamedTuple):
    """Firebrands that came down, [B, n] each."""

    cell: Tensor  # flat index, int64; any cell where they fly over the map's edge
    number: Tensor  # that still glow, float32; 0 there
    ignites: Tensor  # bool, fuel that stands there
    due: Tensor  # tick after which it burns, float32


@mechanic("embers")
@dataclass(frozen=True, kw_only=True)
class Embers(Mechanic):
    """Firebrands that start fires downwind.

    One in 64 cells of a map throws in a tick at most, but up to 64 cells of any map.

    Attributes:
        firebrands: Those of law ``rate``.
        chance: Under the other laws, that a burning tree throws a firebrand in a tick of the paper.
        distance: Under these, median distance for each m/s of the wind [cells s/m]; a calm carries nothing.
        deviation: Under these, standard deviation of the logarithm of the distance.
        sideways: Under these, standard deviation across the wind over the distance.

    Raises:
        ValueError: If a value is out of its range, or of another law than that of the world.
    """

    firebrands: Firebrands = field(default_factory=Firebrands)
    chance: float = 0.02
    distance: float = 1.0
    deviation: float = 0.7
    sideways: float = 0.2

    is_hidden: ClassVar[bool] = True
    maps: ClassVar = {"embers": lambda state: state.planes("embers", Fallen).falls}

    def __post_init__(self) -> None:
        check_fields(self, chance=(0.0, 1.0), distance=(0.0, 100.0), deviation=(0.0, 3.0), sideways=(0.0, 10.0))

    def check(self, world: Rules) -> None:
        """Check that what was given is read under the world's law.

        Raises:
            ValueError: If not.
        """
        usual, has_heat = Embers(), isinstance(world.fire, RateFire)
        of_rate, of_others = ("firebrands",), ("chance", "distance", "deviation", "sideways")
        for name in of_others if has_heat else of_rate:
            if getattr(self, name) != getattr(usual, name):
                law = "other laws than rate" if has_heat else "law rate"
                raise ValueError(f"mechanics.embers.{name} is read under {law} alone, got it under another")

    def begin(self, state: WorldState, world: Rules) -> WorldState:
        """Return worlds in which no ember has fallen; what burns already has thrown its own."""
        fallen = Fallen(
            falls=torch.zeros_like(state.cells),
            due=torch.full_like(state.alpha, _NEVER),
            thrown=is_burning(state.cells),
            spots=torch.zeros_like(state.step),
        )
        return state.with_planes(self.name, fallen)

    def after_tick(self, state: WorldState, ticks_now: Tensor, world: Rules) -> WorldState:
        """Return worlds after embers have fallen in those that ticked, and started fires where they were due."""
        return advance_rows(state, ticks_now, lambda rows, ticks: self._fall(rows, ticks, world.fire))

    def smoulders(self, state: WorldState) -> Tensor:
        """Return in which worlds embers smoulder, bool [B]."""
        return (state.planes(self.name, Fallen).due < _NEVER).flatten(1).any(dim=1)

    def metric_rows(self, world: Rules) -> tuple[Metric, ...]:
        """Return ``spot_fires``."""
        return (Metric("spot_fires", "less", title="fires by embers"),)

    def metrics(self, state: WorldState) -> dict[str, Tensor]:
        """Return ``spot_fires``, the cells that embers have ignited, a share of the map's."""
        return {"spot_fires": state.planes(self.name, Fallen).spots / state.cells[0].numel()}

    def _fall(self, state: WorldState, ticks_now: Tensor, fire: Automaton) -> WorldState:
        here, before = ticks_now[:, None, None], state.planes(self.name, Fallen)
        if isinstance(fire, RateFire):
            burns = is_burning(state.cells)
            sources = here & burns & ~before.thrown
            cell, throws = first_cells(sources, most_cells(state))
            landing = self._of_heat(state, cell, throws, fire)
            waits = sources.flatten(1).scatter(1, cell, sources.flatten(1).gather(1, cell) & ~throws)
            thrown = torch.where(here, burns & ~waits.view_as(burns), before.thrown)
        else:
            cell, throws = first_cells(here & self._throwers(state, fire), most_cells(state))
            landing, thrown = self._of_trees(state, cell, throws, fire), before.thrown
        due = before.due.flatten(1).scatter_reduce(
            1, landing.cell, torch.where(landing.ignites, landing.due, _NEVER), "amin"
        )
        falls = torch.where(here, _shown(landing, state), before.falls)
        fallen = before.replace(falls=falls, due=due.view_as(before.due), thrown=thrown)
        state = state.with_planes(self.name, fallen)
        lights = ticks_now & self._are_due(state).flatten(1).any(dim=1)
        return advance_rows(state, lights, lambda rows, ticks: self._light(rows, ticks, fire))

    def _light(self, state: WorldState, ticks_now: Tensor, fire: Automaton) -> WorldState:
        """Return worlds in which embers that are due have started fires."""
        fallen, lit = state.planes(self.name, Fallen), ticks_now[:, None, None] & self._are_due(state)
        after = ignited(state, fire, lit)
        new = (after.cells != state.cells).flatten(1).sum(dim=1, dtype=torch.int32)
        fallen = fallen.replace(due=torch.where(lit, _NEVER, fallen.due), spots=fallen.spots + new)
        return after.with_planes(self.name, fallen)

    def _are_due(self, state: WorldState) -> Tensor:
        """Return on which cells an ember is due to start a fire, bool [B, H, W]."""
        return state.planes(self.name, Fallen).due <= state.tick[:, None, None]

    def _of_heat(self, state: WorldState, cell: Tensor, throws: Tensor, fire: RateFire) -> _Landing:
        """Return where firebrands of cells, int64 [B, K], land under law ``rate``; of them throw some, bool [B, K]."""
        brands, front, size = self.firebrands, fronts(fire, state, cell, throws), state.ground.cell_size
        number = brands.number(front.intensity, front.rate, size**2) * throws
        east, north = _wind_at(state, cell)
        plume = Plume(front.intensity, front.flame_length, number, east, north)
        flight = brands.flown(plume, *(_draws(state, name, cell, brands.followed) for name in FLIGHT))
        landed, on_map = _landed(cell[..., None], flight.east / size, flight.north / size, state)
        glow = flight.number * on_map
        fuel = fire.can_ignite(state).flatten(1).gather(1, landed.flatten(1)).view_as(landed)
        chance = -torch.expm1(-glow * fuel * brands.ignition(fire.fine_moisture(state.air))[:, None, None])
        ignites = _draws(state, LANDING, cell, brands.followed) < chance
        due = ((front.minutes + brands.minutes(plume)) / fire.minutes)[..., None].expand_as(glow)
        return _Landing(landed.flatten(1), glow.flatten(1), ignites.flatten(1), due.flatten(1))

    def _throwers(self, state: WorldState, fire: Automaton) -> Tensor:
        """Return which burning trees throw a firebrand in this tick, bool [B, H, W]."""
        u = uniform(
            named_key(state.key, self.name), state.tick, Stream.NAMED, (state.cells.shape[1], state.cells.shape[2])
        )
        return fire.spreads(state) & (u < in_finer_time(self.chance, fire.ticks_per_stage))

    def _of_trees(self, state: WorldState, cell: Tensor, throws: Tensor, fire: Automaton) -> _Landing:
        """Return where a firebrand of each of some trees, int64 [B, K], lands; bool [B, K] of them throw one.

        It ignites a tree with the chance of its flammability, at once.
        """
        east, north = _wind_at(state, cell)
        speed = torch.sqrt(east.square() + north.square())
        along, across = (_draws(state, name, cell, 1)[..., 0] for name in FLIGHT)
        downwind = self.distance * lognormal(torch.zeros_like(speed), torch.full_like(speed, self.deviation), along)
        aside = downwind * self.sideways * normal_of(across)
        landed, on_map = _landed(cell, east * downwind + north * aside, north * downwind - east * aside, state)
        flies = throws & on_map
        fuel = (fire.can_ignite(state) * state.alpha).flatten(1).gather(1, landed)
        ignites = flies & (_draws(state, LANDING, cell, 1)[..., 0] < fuel)
        return _Landing(
            landed, flies.to(torch.float32), ignites, state.tick[:, None].expand_as(landed).to(torch.float32)
        )


def most_cells(state: WorldState) -> int:
    """Return how many cells of a world throw in a tick at most, in whole vectors."""
    return filled(state.cells[0].numel() // _SHARE)


def _draws(state: WorldState, name: str, cell: Tensor, each: int) -> Tensor:
    """Return uniform draws of a name of some cells in a tick, float32 [B, K, each]."""
    index = cell[..., None] * each + torch.arange(each, device=cell.device)
    return uniform_at(named_key(state.key, name), state.tick, Stream.NAMED, index.flatten(1).to(torch.int32)).view(
        index.shape
    )


def _wind_at(state: WorldState, cell: Tensor) -> tuple[Tensor, Tensor]:
    """Return the wind to the east and to the north at some cells, float32 [B, K] each [m/s]."""
    wind = state.wind
    east, north = (wind[..., 0] if wind.shape[2:] == (1, 1) else at_cells(wind, cell)).unbind(1)
    return east.expand_as(cell), north.expand_as(cell)


def _landed(cell: Tensor, east: Tensor, north: Tensor, state: WorldState) -> tuple[Tensor, Tensor]:
    """Return the cells so far from some, int64, shape of the distances [cells], and which of them are on the map, bool.

    What comes down where it rose is not, nor is it counted.
    """
    height, width = state.cells.shape[1:]
    row = cell.div(width, rounding_mode="floor") - north.clamp(-height, height).round().to(torch.int64)
    column = cell % width + east.clamp(-width, width).round().to(torch.int64)
    landed = row.clamp(0, height - 1) * width + column.clamp(0, width - 1)
    return landed, (row >= 0) & (row < height) & (column >= 0) & (column < width) & (landed != cell)


def _shown(landing: _Landing, state: WorldState) -> Tensor:
    """Return 255 times the chance that a firebrand glows on each cell, uint8 [B, H, W]."""
    parts = (landing.number.clamp(max=_MOST) * _PARTS).round().to(torch.int32)
    total = torch.zeros_like(state.cells, dtype=torch.int32).flatten(1).scatter_add(1, landing.cell, parts)
    return (-255.0 * torch.expm1(-total.view_as(state.cells) / _PARTS)).round().to(torch.uint8)
