"""Measures of a fire: the worth that is left, whether it escaped, the minutes until it was contained, and its cost."""

from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import ClassVar

import torch
from torch import Tensor

from warp_torchrl.validation import check_fields, did_you_mean
from warp_torchrl.world.arrays.batch import Batch
from warp_torchrl.world.arrays.bytes import above, between
from warp_torchrl.world.arrays.constants import numbers
from warp_torchrl.world.arrays.geometry import grow
from warp_torchrl.world.arrays.listing import filled
from warp_torchrl.world.arrays.shortlist import first_cells, marked_cells
from warp_torchrl.world.backends.backend import advance_rows
from warp_torchrl.world.backends.fronts import fronts
from warp_torchrl.world.law.automaton import Automaton
from warp_torchrl.world.law.rate import RateFire
from warp_torchrl.world.mechanics.mechanic import Mechanic, Metric, Rules
from warp_torchrl.world.mechanics.minutes import check_minutes, minutes_of_tick
from warp_torchrl.world.mechanics.table import mechanic
from warp_torchrl.world.mechanics.values.assets import has_assets, worth_of_assets
from warp_torchrl.world.mechanics.values.response import HOMES, RATES, kept, longest_about, share_left
from warp_torchrl.world.state.cells import is_burning
from warp_torchrl.world.state.role import ROLES
from warp_torchrl.world.state.state import OLDEST, WorldState

_SHARE = 8
"""One in so many cells of a map has its flames measured in a tick at most; others of law ``rate`` in the next one."""
_FLAMES = 1e-3  # m, of the least fire that is one
_HECTARE = 1e4  # m2
_LEAST = 1e-6  # ha


@dataclass(eq=False, repr=False)
class Exposure(Batch):
    """What is worth something, what it was exposed to, and what the fire has cost."""

    worth: Tensor  # float32 [B,H,W], before the fire, in any unit
    flames: Tensor  # float32 [B,H,W], the longest that each cell was exposed to [m]
    spared: Tensor  # float32 [B,H,W], chance that no ember has ignited what stands there
    met: Tensor  # bool [B,H,W], burns or has burned, and its flames were measured
    burns: Tensor  # bool [B,H,W], as of the last tick
    grew: Tensor  # float32 [B], when a cell last caught fire, since ignition [minutes]
    now: Tensor  # float32 [B], since ignition [minutes]
    held: Tensor  # bool [B], the fire has nowhere to go
    cost: Tensor  # float32 [B], of the vehicles so far [US dollars]
    left: Tensor  # float32 [B], share of the worth that is left
    size: Tensor  # float32 [B], area of the fire over that from which it has escaped


@mechanic("values")
@dataclass(frozen=True, kw_only=True)
class Values(Mechanic):
    """Houses and other assets that a fire may destroy, and the measures of initial attack.

    The worth of cells is the sum of the landscape's layer ``assets``, of ``points`` and of ``houses``; without all of
    them each tree is worth 1. Flames take a share of it by their length, and embers of the mechanic ``embers`` may
    ignite it. Assets on ground that cannot burn are exposed to the longest flames near them.

    Attributes:
        points: (row, column, worth) of assets; rows and columns are those of the landscape's source [cells].
        houses: How many are drawn over the dry ground, each worth 1.
        downwind: Least and greatest distance of these houses down the wind from the fire [cells], within 45 degrees of
            it; more stand elsewhere where they do not fit. None: anywhere.
        losses: Share of the worth that is lost at each of the six fire intensity levels, flames up to 2, 4, 6, 8 and
            12 ft and over.
        reach: How far flames ignite assets on ground that cannot burn [m]: crown fires about 30 m (Cohen 2004).
        ember_chance: That an asset ignites in a tick in which a firebrand glows on its cell for sure. No measured value
            is known: it depends on roof, vents and gardens. 0 leaves embers out.
        flame_length: Of flames under laws other than ``rate`` [m].
        escape_area: A fire that is larger has escaped [ha]: the 100 acres from which class D begins (NWCG PMS 205).
        rates: Cost of a vehicle by role [US dollars an hour]; of roles that are not named 250 for ugv, 2000 uav, 500
            scout, 7000 tanker.
        minutes_per_tick: Under laws without minutes; None: 10.

    Raises:
        ValueError: If a value is out of its range.
    """

    points: tuple[tuple[float, float, float], ...] = ()
    houses: int = 0
    downwind: tuple[float, float] | None = None
    losses: tuple[float, float, float, float, float, float] = HOMES
    reach: float = 30.0
    ember_chance: float = 0.1
    flame_length: float = 3.0
    escape_area: float = 40.0
    rates: Mapping[str, float] = field(default_factory=dict)
    minutes_per_tick: float | None = None

    turn: ClassVar[int] = 1  # after what lights cells and lends vehicles
    maps: ClassVar = {"worth": lambda state: _shown(state)}

    def __post_init__(self) -> None:
        check_fields(
            self,
            houses=(0, 100_000),
            reach=(0.0, 500.0),
            ember_chance=(0.0, 1.0),
            flame_length=(0.1, 100.0),
            escape_area=(0.0, 1e9),
            rates=(0.0, 1e6),
            minutes_per_tick=(1e-3, 1440.0),
        )
        if self.downwind is not None:
            if not self.houses:
                raise ValueError(f"downwind is read with houses, got {list(self.downwind)} and no houses")
            if not 0.0 <= self.downwind[0] <= self.downwind[1] <= 1e6:
                raise ValueError(f"downwind must be distances of 0 or more, the least first, got {list(self.downwind)}")
        if not all(0.0 <= loss <= 1.0 for loss in self.losses):
            raise ValueError(f"losses must be in [0, 1], got {list(self.losses)}")
        if any(worth < 0.0 for _, _, worth in self.points):
            raise ValueError(f"points must be worth 0 or more, got {min(worth for *_, worth in self.points):g}")

    def check(self, world: Rules) -> None:
        """Check that the world reads what was given, and that each role has a rate.

        Raises:
            ValueError: If not.
        """
        check_minutes(world, self.name, self.minutes_per_tick)
        if isinstance(world.fire, RateFire) and self.flame_length != Values().flame_length:
            raise ValueError(
                "mechanics.values.flame_length is read under other laws than rate alone, got it under rate"
            )
        for role in world.team.agent_roles:
            if role not in {**RATES, **self.rates}:
                raise ValueError(f"mechanics.values.rates must name each role of the team, got none for {role}")
        for role in self.rates:
            if role not in ROLES:
                raise ValueError(f"mechanics.values.rates must name roles, got {role}{did_you_mean(role, ROLES)}")

    def begin(self, state: WorldState, world: Rules) -> WorldState:
        """Return worlds at the start of an episode, with what stands there; nothing was exposed or used yet."""
        since = state.tick.to(torch.float32) * minutes_of_tick(world, self.minutes_per_tick)
        exposure = Exposure(
            worth=worth_of_assets(state, self.points, self.houses, self.downwind),
            flames=torch.zeros_like(state.alpha),
            spared=torch.ones_like(state.alpha),
            met=torch.zeros_like(state.burned),
            burns=is_burning(state.cells),
            grew=since,
            now=since.clone(),
            held=torch.zeros_like(state.terminated),
            cost=torch.zeros_like(since),
            left=torch.ones_like(since),
            size=self._size(state),
        )
        return state.with_planes(self.name, exposure)

    def after_tick(self, state: WorldState, ticks_now: Tensor, world: Rules) -> WorldState:
        """Return worlds whose assets were exposed to the flames and embers of a tick, where one was."""
        return advance_rows(state, ticks_now, lambda rows, ticks: self._expose(rows, ticks, world))

    def step(self, before: WorldState, after: WorldState, running: Tensor, world: Rules) -> WorldState:
        """Return worlds in which the vehicles that are there have cost another step."""
        exposure, there = after.planes(self.name, Exposure), after.plane("arrivals", "present")
        rates = numbers(self._hourly(world), after.alpha.device)
        spent = (rates if there is None else rates * there).expand(after.vehicles.acts.shape).sum(dim=1)
        hours = minutes_of_tick(world, self.minutes_per_tick) / world.steps_per_tick / 60.0
        return after.with_planes(self.name, exposure.replace(cost=exposure.cost + spent * running * hours))

    def metric_rows(self, world: Rules) -> tuple[Metric, ...]:
        """Return ``worth_saved``, ``escaped``, ``contained``, ``contained_at``, ``fire_size`` and ``cost``."""
        return (
            Metric("worth_saved", "more", title="worth saved"),
            Metric("escaped", "less"),
            Metric("contained", "more"),
            Metric("contained_at", "less", "min", title="contained at"),
            Metric("fire_size", "less", "ha", title="fire size"),
            Metric("cost", "less", "USD"),
        )

    def metrics(self, state: WorldState) -> dict[str, Tensor]:
        """Return the measures of each world's fire so far.

        ``worth_saved`` is the share of the worth that is left, 1 where there was none; ``fire_size`` [ha] the area that
        burns, has burned or was put out; ``escaped`` 1 where that is over ``escape_area``; ``contained`` 1 where the
        fire has nowhere to go; ``contained_at`` the minutes from ignition until a cell last caught fire, and where the
        fire is not contained until now; ``cost`` that of the vehicles.
        """
        exposure, area = state.planes(self.name, Exposure), _area(state)
        held = exposure.held | state.terminated
        return {
            "worth_saved": exposure.left.clone(),
            "escaped": (area > self.escape_area).to(torch.float32),
            "contained": held.to(torch.float32),
            "contained_at": torch.where(held, exposure.grew, exposure.now),
            "fire_size": area,
            "cost": exposure.cost.clone(),
        }

    def degree(self, state: WorldState, goal: str) -> Tensor | None:
        """Return by ``escaped`` the share of ``escape_area`` that the fire has, at most 1, as a loss."""
        return -state.planes(self.name, Exposure).size.clamp(max=1.0) if goal == "escaped" else None

    def buildings(self, state: WorldState) -> Tensor | None:
        """See ``Mechanic``: the assets. None where every tree is worth the same."""
        if not has_assets(state, self.points, self.houses):
            return None
        exposure = state.planes(self.name, Exposure)
        return torch.where(exposure.worth > 0.0, kept(exposure.flames, exposure.spared, self.losses), -1.0)

    def caption(self, state: WorldState) -> tuple[str, ...]:
        """Return the worth that is left, the area of the fire, and what became of it."""
        now = {name: float(each[0]) for name, each in self.metrics(state[:1]).items()}
        size = f"fire {now['fire_size']:.{0 if now['fire_size'] >= 10.0 else 1}f} ha"
        end = "escaped" if now["escaped"] else "contained" if now["contained"] else ""
        return f"{now['worth_saved']:.0%} of worth left", f"{size}, {end}" if end else size

    def _size(self, state: WorldState) -> Tensor:
        """Return the area of the fire over that from which it has escaped, float32 [B]."""
        return _area(state) / max(self.escape_area, _LEAST)

    def _expose(self, state: WorldState, ticks_now: Tensor, world: Rules) -> WorldState:
        before, here, burns = state.planes(self.name, Exposure), ticks_now[:, None, None], is_burning(state.cells)
        cells = min(int(self.reach / state.ground.cell_size), state.cells.shape[1])
        has_worth = above(before.worth, 0.0)
        bare = has_worth & ~above(state.alpha, 0.0)
        new = here & (has_worth | grow(bare, cells)) & (burns | state.burned) & ~before.met
        flames, measured = self._flames(state, new, world.fire)
        met = torch.where(bare, longest_about(flames, cells), flames)
        since = state.tick * minutes_of_tick(world, self.minutes_per_tick)
        grows = (burns & ~before.burns).flatten(1).any(1)
        exposure = before.replace(
            flames=torch.maximum(before.flames, met),
            spared=self._spared(state, before.spared, here),
            met=before.met | measured,
            burns=torch.where(here, burns, before.burns),
            grew=torch.where(ticks_now & grows, since, before.grew),
            now=torch.where(ticks_now, since, before.now),
            held=torch.where(ticks_now, _is_held(state, world), before.held),
            size=torch.where(ticks_now, self._size(state), before.size),
        )
        left = share_left(exposure.worth, exposure.flames, exposure.spared, self.losses)
        return state.with_planes(self.name, exposure.replace(left=left))

    def _spared(self, state: WorldState, spared: Tensor, here: Tensor) -> Tensor:
        """Return the chance that no ember has ignited an asset, float32 [B, H, W], after a tick."""
        glow = state.plane("embers", "falls")
        if glow is None:
            return spared
        glow = torch.where(here, glow, 0)
        cell = marked_cells(glow > 0)
        caught = self.ember_chance * glow.flatten().index_select(0, cell).to(torch.float32) / 255.0
        after = spared.flatten().index_select(0, cell) * (1.0 - caught)
        return spared.flatten().index_copy(0, cell, after).view_as(spared)

    def _flames(self, state: WorldState, new: Tensor, fire: Automaton) -> tuple[Tensor, Tensor]:
        """Return the flame length in marked cells that burn or have burned, float32 [B, H, W] [m]; else 0.

        And which of them were measured, bool [B, H, W].
        """
        if not isinstance(fire, RateFire):
            return torch.where(new, self.flame_length, 0.0), new
        cell, is_there = first_cells(new, filled(new[0].numel() // _SHARE))
        found = torch.where(is_there, fronts(fire, state, cell, is_there).flame_length.clamp(min=_FLAMES), 0.0)
        none = torch.zeros_like(state.alpha)
        flames = none.flatten(1).scatter_reduce(1, cell, found, "amax").view_as(none)
        return flames, above(flames, 0.0)

    def _hourly(self, world: Rules) -> tuple[float, ...]:
        """Return what each vehicle costs [US dollars an hour]."""
        rates = {**RATES, **self.rates}
        return tuple(rates[role] for role in world.team.agent_roles)


def _area(state: WorldState) -> Tensor:
    """Return the area that burns, has burned or was put out, float32 [B] [ha]."""
    touched = is_burning(state.cells) | state.burned | state.extinguished
    return touched.flatten(1).sum(dim=1) * (state.ground.cell_size**2 / _HECTARE)


def _is_held(state: WorldState, world: Rules) -> Tensor:
    """Return in which worlds no fire is beside what may burn, wet or not, and no ember smoulders, bool [B]."""
    fuel = between(state.cells, world.fire.youngest_fuel, OLDEST) & above(state.alpha, 0.0)
    goes_on = (world.fire.spreads(state) & grow(fuel)).flatten(1).any(dim=1)
    for each in world.loop:
        smoulders = each.smoulders(state)
        goes_on = goes_on if smoulders is None else goes_on | smoulders
    return ~goes_on


def _shown(state: WorldState) -> Tensor:
    """Return what each cell was worth before the fire, over the most of its world, 255 times, uint8 [B, H, W]."""
    worth = state.planes("values", Exposure).worth
    most = worth.flatten(1).amax(dim=1).clamp(min=1e-30)[:, None, None]
    return torch.where(worth > 0.0, (worth / most * 255.0).round().clamp(min=1.0), 0.0).to(torch.uint8)
