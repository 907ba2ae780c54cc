"""Many fires on one map under law ``rate``, and what is read off them."""

from collections.abc import Callable, Iterator
from dataclasses import dataclass
from pathlib import Path

import torch
from torch import Tensor

from warp_torchrl.prediction.passing import Behaviour
from warp_torchrl.prediction.tally import Tally
from warp_torchrl.weather.table import WeatherTable, read_weather
from warp_torchrl.world.alone import Spell, arrival_minutes, spread_in
from warp_torchrl.world.random import world_key
from warp_torchrl.world.rate import RateFire
from warp_torchrl.world.state import Landscape
from warp_torchrl.world.weather import Weather

_MOST_TIMES = 2**31  # of fires and cells: 4 GiB


@dataclass(frozen=True, kw_only=True, eq=False)
class Prediction:
    """What fires on one map did. Maps are [H, W]; where no fire came they hold NaN."""

    burn_probability: Tensor  # share of the fires that came, float32
    arrival_minutes: Tensor  # median over the fires that came, float32 [min]
    arrival_early: Tensor  # a tenth of them came before, float32 [min]
    arrival_late: Tensor  # a tenth of them came after, float32 [min]
    half_minutes: Tensor  # when half of all fires had come; NaN where fewer ever did, float32 [min]
    rate: Tensor  # of spread as the fire came, mean over the fires that came, float32 [m/min]
    intensity: Tensor  # fireline intensity then, the same, float32 [kW/m]
    flame_length: Tensor  # the same, float32 [m]
    hours: Tensor  # since the fires' start, float32 [T]: 0, 1, 2 ...
    area: Tensor  # burned by then in each fire, float32 [B, T] [ha]
    final_area: Tensor  # burned in each fire at its end, float32 [B] [ha]
    progress: Tensor  # the farthest that each fire had come from the middle of its start, float32 [B, T] [m]
    left_map: Tensor  # whether a fire came to the map's edge, bool [B]
    followed: Tensor  # how long each fire was followed, float32 [B] [min]
    first_fire: Tensor  # arrival of the first fire, float32 [H, W] [min], NaN where it did not come
    head_rate: Tensor  # highest rate of the model in each spell of weather, of all cells but one in a thousand [m/min]
    lit: Tensor  # where fires started, bool [H, W]
    ground: Landscape  # batch size [1]
    cell_size: float  # side of a cell [m]

    def burned_by(self, hour: float) -> Tensor:
        """Return where at least half of the fires had come by an hour, bool [H, W]."""
        return self.half_minutes <= 60.0 * hour


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
    progress: Callable[[int], object] | None = None,
) -> Prediction:
    """Burn many fires on one map, in weather by the hour, and return what a fire scientist reads off them.

    The fires differ in the rates that are drawn for their cells (``RateFire.cell_deviation``) and for themselves
    (``fire_deviation``). Without both they are all alike, and one is enough.

    Args:
        ground: The map, batch size [1]; its age must be 1 or more wherever fuel can burn.
        weather: A table, or the CSV file that it is read from.
        ignition: The cells that burn at the start, bool [H, W]; those without fuel are left out.
        fire: The law with its fuel model; None is ``RateFire()``.
        cell_size: Side of a cell [m].
        hours: How long fires are followed; None: to the end of the weather.
        area: Area at which a fire stops, even before [ha]; None lets it go on.
        fires: How many.
        seed: Fire i has seed ``seed + i``.
        start: When the fires start, since the weather's first row began [minutes].
        convergence: Angle from true north, of the weather's bearings, to the map's grid north, clockwise [degrees].
        progress: Called with how many fires have been burned since the last call.

    Raises:
        ValueError: If a value is out of its range, nothing that is lit can burn, or the fires do not fit in memory.
    """
    law = RateFire() if fire is None else fire
    _check(ground, ignition, cell_size)
    _check_numbers(ground, fires, area, hours, seed)
    table = weather if isinstance(weather, WeatherTable) else read_weather(weather)
    minutes = lasting(table, start) if hours is None else 60.0 * hours
    air = Weather(table=table, convergence=convergence)
    met = [Spell(wind, lasts, moisture) for wind, moisture, lasts in air.spells(minutes, start)]
    lit = ignition.cpu() & (law.flammability(ground)[0] > 0.0) & (ground.age[0] >= law.youngest_fuel)
    if not bool(lit.any()):
        raise ValueError(f"ignition must light a cell with fuel, none of its {int(ignition.sum())} cells has any")
    spreads = [spread_in(law, ground, cell_size, spell) for spell in met]
    behaviour = Behaviour.of(spreads, [spell.minutes for spell in met])
    tally = Tally(behaviour, lit, minutes, cell_size, area)
    key = world_key(seed + torch.arange(fires))
    for arrival, pace in _burned(law, ground, lit, key, met, cell_size):
        tally.add(arrival, pace)
        if progress is not None:
            progress(len(arrival))
    return _prediction(tally, behaviour, lit, ground, cell_size)


def _burned(
    law: RateFire, ground: Landscape, lit: Tensor, key: Tensor, met: list[Spell], cell_size: float
) -> Iterator[tuple[Tensor, Tensor]]:
    """Yield the arrival times of some fires and the factor on their times, float32 [b, H, W] each."""
    done = 0
    for arrival in arrival_minutes(law, ground, lit, key, met, cell_size):
        yield arrival, law.pace(key[done : done + len(arrival)], (lit.shape[0], lit.shape[1]))
        done += len(arrival)


def _prediction(tally: Tally, behaviour: Behaviour, lit: Tensor, ground: Landscape, cell_size: float) -> Prediction:
    times, (rate, intensity, flame_length) = tally.arrivals(), tally.means()
    first = torch.zeros(0) if tally.first is None else tally.first
    share = max(1, round(0.999 * behaviour.head.shape[1]))
    return Prediction(
        burn_probability=tally.burn_probability(),
        arrival_minutes=times.median,
        arrival_early=times.early,
        arrival_late=times.late,
        half_minutes=times.half,
        rate=rate.masked_fill(lit, torch.nan),
        intensity=intensity.masked_fill(lit, torch.nan),
        flame_length=flame_length.masked_fill(lit, torch.nan),
        hours=tally.hours,
        area=tally.joined("area"),
        final_area=tally.joined("final"),
        progress=tally.joined("progress"),
        left_map=tally.joined("left"),
        followed=tally.joined("followed"),
        first_fire=torch.where(first < 1e8, first, torch.nan),
        head_rate=behaviour.head.kthvalue(share, dim=1).values,
        lit=lit,
        ground=ground,
        cell_size=cell_size,
    )


def lasting(table: WeatherTable, start: float) -> float:
    """Return the minutes from a start to the end of the last row, which lasts as long as the one before; 1 hour alone.

    Raises:
        ValueError: If the start is not before that end.
    """
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


def _check_numbers(ground: Landscape, fires: int, area: float | None, hours: float | None, seed: int) -> None:
    """Refuse numbers out of their ranges."""
    rows, columns = ground.cover.shape[1:]
    if not 1 <= fires <= 1_000_000:
        raise ValueError(f"fires must be in 1..1000000, got {fires}")
    if fires * rows * columns > _MOST_TIMES:
        most = _MOST_TIMES // (rows * columns)
        raise ValueError(f"fires must be at most {most} on {rows} x {columns} cells, for memory, got {fires}")
    if area is not None and not 0.0 < area < 1e9:
        raise ValueError(f"area must be over 0 and under 1e9 ha, got {area:g}")
    if hours is not None and not 0.0 < hours <= 1e5:
        raise ValueError(f"hours must be over 0 and at most 1e5, got {hours:g}")
    if seed < 0:
        raise ValueError(f"seed must be 0 or more, got {seed}")
