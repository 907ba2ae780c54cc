"""Prediction of many fires on one map under law ``rate``: its maps and curves."""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path

import torch
from torch import Tensor

from warp_torchrl.prediction.counts import Counter
from warp_torchrl.prediction.tally import Tally
from warp_torchrl.world.air.fields import WeatherFields
from warp_torchrl.world.air.sunlight import Sunlight
from warp_torchrl.world.air.weather import Weather
from warp_torchrl.world.arrays.random import world_key
from warp_torchrl.world.behaviour.firebrands import Firebrands
from warp_torchrl.world.fires.members import Members
from warp_torchrl.world.fires.pieces import Gusts
from warp_torchrl.world.fires.sightings import beside
from warp_torchrl.world.fires.spell import spells_of
from warp_torchrl.world.law.rate import RateFire
from warp_torchrl.world.state.state import Landscape
from warp_torchrl.world.state.window import Window
from warp_torchrl.world.weather.table import WeatherTable, read_weather

_NOWHERE = {"burn_probability": 0.0}
"""What maps hold where no fire came; the others hold NaN."""
CROWN_MAPS = ("crown_fire", "active_crown_fire")
"""Maps of fires that ran in crowns, where the ground knows them."""
_LARGEST_SEED = 2**62
_LONGEST = 1e8  # minutes: two centuries


@dataclass(frozen=True, kw_only=True, eq=False)
class Prediction:
    """What fires on one map did. Maps are [H, W]; they are kept in a window that has all fires."""

    window: Window
    seen: Mapping[str, Tensor]  # the maps in the window, float32 [h, w], by their names
    hours: Tensor  # since the fires' start, float32 [T]: 0, 1, 2 ...
    area: Tensor  # burned by then in each fire, float32 [B, T] [ha]
    final_area: Tensor  # burned in each fire at its end, float32 [B] [ha]
    progress: Tensor  # the farthest that each fire had come from the middle of its start, float32 [B, T] [m]
    left_map: Tensor  # whether a fire came to the map's edge, bool [B]
    followed: Tensor  # how long each fire was followed, float32 [B] [min]
    head_rate: Tensor  # highest in each spell that a fire met, of all cells but one in a thousand [m/min]
    lit: Tensor  # where fires were lit, at the start or later, bool [H, W]
    ground: Landscape  # batch size [1]
    cell_size: float  # side of a cell [m]
    at_once: int = 1  # most fires that burned together
    every: Tensor | None = None  # when each fire came, float32 [B, h, w] [min], NaN where it did not; where kept

    @property
    def burn_probability(self) -> Tensor:
        """Return the share of the fires that came, float32 [H, W]."""
        return self._map("burn_probability")

    @property
    def arrival_minutes(self) -> Tensor:
        """Return the median arrival time over the fires that arrived [min], float32 [H, W]; NaN where none did."""
        return self._map("arrival_minutes")

    @property
    def arrival_early(self) -> Tensor:
        """Return the time before which a tenth of the fires that came did [min], float32 [H, W]; NaN where none did."""
        return self._map("arrival_early")

    @property
    def arrival_late(self) -> Tensor:
        """Return the time after which a tenth of the fires that came did [min], float32 [H, W]; NaN where none did."""
        return self._map("arrival_late")

    @property
    def half_minutes(self) -> Tensor:
        """Return when half of all fires had come [min], float32 [H, W]; NaN where fewer ever did."""
        return self._map("half_minutes")

    @property
    def rate(self) -> Tensor:
        """Return the mean rate of spread on arrival over the fires that did [m/min], float32 [H, W]; NaN for none."""
        return self._map("rate")

    @property
    def intensity(self) -> Tensor:
        """Return the mean fireline intensity on arrival [kW/m], float32 [H, W]."""
        return self._map("intensity")

    @property
    def flame_length(self) -> Tensor:
        """Return the mean flame length on arrival [m], float32 [H, W]."""
        return self._map("flame_length")

    @property
    def has_crowns(self) -> bool:
        """Return whether the ground knows its crowns, so that fires may run in them."""
        return all(name in self.seen for name in CROWN_MAPS)

    @property
    def crown_fire(self) -> Tensor:
        """Return the share of the fires that came which ran in crowns, float32 [H, W]; NaN where none came."""
        return self._map("crown_fire")

    @property
    def active_crown_fire(self) -> Tensor:
        """Return the share of the fires that came which were active crown fire, float32 [H, W]."""
        return self._map("active_crown_fire")

    @property
    def first_fire(self) -> Tensor:
        """Return when the first fire came [min], float32 [H, W]; NaN where it did not."""
        return self._map("first_fire")

    @property
    def ground_seen(self) -> Landscape:
        """Return the ground of the window, batch size [1]."""
        return self.ground if self.window.is_whole else self.window.landscape(self.ground)

    def burned_by(self, hour: float) -> Tensor:
        """Return where at least half of the fires had come by an hour, bool [H, W]."""
        return self.half_minutes <= 60.0 * hour

    def _map(self, name: str) -> Tensor:
        plane = torch.full(self.window.map, _NOWHERE.get(name, torch.nan))
        return self.window.put(self.seen[name], plane)


def predict(
    ground: Landscape,
    weather: WeatherTable | str | Path,
    ignition: Tensor,
    *,
    fire: RateFire | None = None,
    cell_size: float = 30.0,
    hours: float | None = None,
    area: float | None = None,
    fires: int = 100,
    seed: int = 0,
    start: float = 0.0,
    convergence: float = 0.0,
    fields: WeatherFields | None = None,
    sunlight: Sequence[Sunlight] | None = None,
    gusts: Gusts | None = None,
    members: Members | None = None,
    is_seen: bool = False,
    embers: Firebrands | None = None,
    later: Tensor | None = None,
    keep_every: bool = False,
    progress: Callable[[int], object] | None = None,
) -> Prediction:
    """Burn many fires on one map, in hourly weather, and return their maps and curves.

    The fires differ in the rates that are drawn for their cells (``RateFire.cell_deviation``) and for themselves
    (``fire_deviation``). Without both they are all alike, and one is enough.

    Args:
        ground: The map, batch size [1]; its age must be 1 or more wherever fuel can burn.
        weather: A table, or the CSV file that it is read from.
        ignition: The cells that burn at the start, bool [H, W]; those without fuel are left out.
        fire: The law with its fuel model; None is ``RateFire()``.
        cell_size: Side of a cell [m].
        hours: How long fires are followed; None: to the end of the weather.
        area: Area at which a fire stops, even before [ha]; None for no limit.
        fires: Number of fires.
        seed: Fire i has seed ``seed + i``.
        start: When the fires start, since the weather's first row began [minutes].
        convergence: Angle from true north, of the weather's bearings, to the map's grid north, clockwise [degrees].
        fields: The weather's hours by place on the map, whose means are the table's rows; None: one weather for all.
        sunlight: How dead fuel differs by aspect, slope and shade, row by row: ``air.sunlight.by_sunlight``.
        gusts: How fires draw their winds about the mean; None: they have the mean wind.
        members: By what fires differ in rate, wind and moisture, one for each; None: by ``fire_deviation`` alone.
        is_seen: Whether the ignition is what a fire had burned when it was seen: its front is on average half a cell
            ahead then.
        embers: Firebrands that start fires ahead; None: none fly.
        later: When further cells are lit, float32 [H, W] in minutes since the start, infinite where they are not;
            None: none are.
        keep_every: Whether the prediction keeps the arrival times of every fire.
        progress: Called with how many fires have been burned since the last call.

    Raises:
        ValueError: If a value is out of its range, nothing that is lit can burn, or the fires do not fit in memory.
            What they take grows with their window: rates are computed hour by hour, and only about the fires.
    """
    law = RateFire() if fire is None else fire
    _check(ground, ignition, cell_size)
    _check_numbers(fires, area, hours, seed)
    if members is not None and len(members) != fires:
        raise ValueError(f"members must be as many as fires, {fires}, got {len(members)}")
    _check_times(start, convergence)
    table = weather if isinstance(weather, WeatherTable) else read_weather(weather)
    left = lasting(table, start)
    minutes = left if hours is None else 60.0 * hours
    met = spells_of(Weather(table=table, convergence=convergence, fields=fields, sunlight=sunlight), minutes, start)
    front = beside(ignition.cpu()) if is_seen else None
    who = Members.plain(fires) if members is None else members
    if gusts is not None:
        gusts.check(table)
        met, who = gusts.blocks(met), replace(who, gusts=world_key(seed + torch.arange(fires)))
    order = who.by_pace()
    burning = who.part(order).fires(law, ground, met, cell_size, front, embers, in_paces=True, later=later)
    lit = ignition.cpu() & burning.fuel
    every = lit if later is None else lit | (burning.fuel & (later <= minutes))
    if not bool(every.any()):
        given = int(ignition.sum()) if later is None else int((ignition | later.isfinite()).sum())
        raise ValueError(f"ignition must light a cell with fuel, none of its {given} cells has any")
    count = Counter(fires=burning, lit=lit if bool(lit.any()) else every, minutes=minutes, area=area)
    tally = Tally(fires, minutes, order)
    tally.check(Window.about(count.lit))
    for part in burning.in_parts(lit, world_key(seed + order), count, count.most_cells):
        tally.add(part)
        if progress is not None:
            progress(len(part.left))
    return _prediction(tally, count, every, keep_every)


def _prediction(tally: Tally, count: Counter, ever_lit: Tensor, keep_every: bool) -> Prediction:
    times, (rate, intensity, flame_length, *crowns) = tally.arrivals(), tally.means()
    window, fires = tally.window.on_map, count.fires
    lit = tally.window.cut(ever_lit, False)
    maps = {
        "burn_probability": tally.burn_probability(),
        "arrival_minutes": times.median,
        "arrival_early": times.early,
        "arrival_late": times.late,
        "half_minutes": times.half,
        "rate": rate.masked_fill(lit, torch.nan),
        "intensity": intensity.masked_fill(lit, torch.nan),
        "flame_length": flame_length.masked_fill(lit, torch.nan),
        "first_fire": tally.first,
        **{name: each.masked_fill(lit, torch.nan) for name, each in zip(CROWN_MAPS, crowns, strict=False)},
    }
    return Prediction(
        window=window,
        seen={name: plane[:, : window.width] for name, plane in maps.items()},
        hours=count.hours,
        area=tally.joined("area"),
        final_area=tally.joined("final"),
        progress=tally.joined("progress"),
        left_map=tally.joined("left"),
        followed=tally.joined("followed"),
        head_rate=torch.tensor([fires.fastest(number)[1] for number in range(fires.n_met)]),
        lit=ever_lit,
        ground=fires.landscape,
        cell_size=fires.cell_size,
        at_once=tally.at_once,
        every=tally.every()[:, :, : window.width] if keep_every else None,
    )


def lasting(table: WeatherTable, start: float) -> float:
    """Return the minutes from a start to the end of the last row, which lasts as long as the one before; 1 hour alone.

    Raises:
        ValueError: If the start is before the first row, or not before that end.
    """
    if not start >= 0.0:
        raise ValueError(f"start must not be before the weather's first row, got {-start:g} minutes before it")
    hours = table.hours.double()
    last = float(hours[-1] - hours[-2]) if len(hours) > 1 else 1.0
    end = (float(hours[-1]) + last) * 60.0
    if not start < end:
        raise ValueError(f"start must be before the weather's end, {end:g} minutes after its first row, got {start:g}")
    return end - start


def _check(ground: Landscape, ignition: Tensor, cell_size: float) -> None:
    """Refuse maps that do not fit."""
    shape = ground.cover.shape[1:]
    if len(ground.cover) != 1:
        raise ValueError(f"ground must be one map, batch size 1, got {len(ground.cover)}")
    if ignition.dtype != torch.bool or ignition.shape != shape:
        raise ValueError(f"ignition must be bool {list(shape)}, got {ignition.dtype} {list(ignition.shape)}")
    if not 0.0 < cell_size <= 1e5:
        raise ValueError(f"cell_size must be over 0 and at most 1e5 m, got {cell_size:g}")


def _check_numbers(fires: int, area: float | None, hours: float | None, seed: int) -> None:
    """Refuse numbers out of their ranges."""
    if not 1 <= fires <= 1_000_000:
        raise ValueError(f"fires must be in 1..1000000, got {fires}")
    if area is not None and not 0.0 < area < 1e9:
        raise ValueError(f"area must be over 0 and under 1e9 ha, got {area:g}")
    if hours is not None and not 0.0 < hours <= 1e5:
        raise ValueError(f"hours must be over 0 and at most 1e5, got {hours:g}")
    if not 0 <= seed <= _LARGEST_SEED:
        raise ValueError(f"seed must be in 0..2^62, got {seed}")


def _check_times(start: float, convergence: float) -> None:
    if not abs(start) <= _LONGEST:
        raise ValueError(f"start must be within {_LONGEST:g} minutes of the weather's first row, got {start:g}")
    if not -360.0 <= convergence <= 360.0:
        raise ValueError(f"convergence must be in [-360, 360] degrees, got {convergence:g}")
