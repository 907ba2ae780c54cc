"""Fire simulation without vehicles."""

import math
from dataclasses import dataclass
from pathlib import Path

import torch
from torch import Tensor

from warp_torchrl.runs.config.compose import compose_config
from warp_torchrl.runs.config.construction import build
from warp_torchrl.runs.config.plain_values import plain
from warp_torchrl.system.modes import apart
from warp_torchrl.world.air.weather import Weather
from warp_torchrl.world.air.wind import Wind, constant_wind
from warp_torchrl.world.fires.burn import FireHistory, burn, start_burning, trace
from warp_torchrl.world.law.automaton import Automaton
from warp_torchrl.world.law.rate import RateFire
from warp_torchrl.world.state.state import EMBER, Cover, Landscape, WorldState
from warp_torchrl.world.weather.table import WeatherTable, read_weather


@apart
def simulate(
    cells: Tensor,
    cover: Tensor,
    elevation: Tensor | None = None,
    wind: tuple[float, float] | Wind = (0.0, 0.0),
    fire: str | Automaton = "paper",
    ticks: int = 1,
    first_tick: int = 0,
    seed: int = 0,
    cell_size: float = 30.0,
    stage_age: Tensor | None = None,
    fuel: Tensor | None = None,
    weather: WeatherTable | str | Path | None = None,
) -> Tensor:
    """Simulate the fire without vehicles, with the environment's own code.

    Args:
        cells: The paper's codes, uint8 [B, H, W]: 0 empty, 1..10 tree age, 11..15 fire.
        cover: Land cover, uint8 [B, H, W]: 0 lake, 1 wetland, 2 grassland, 3 forest, 4 bare.
        elevation: In metres, float32 [B, H, W]; None is flat.
        wind: (u east, v north) of the air's motion [m/s], or a wind component.
        fire: One of ``conf/fire``, ``paper`` being the complete automaton, or a law.
        ticks: Fire ticks to run.
        first_tick: Ticks already run, to continue a simulation.
        seed: World i has seed ``seed + i``.
        cell_size: Side of a cell [m].
        stage_age: Ticks that each burning cell has spent in its stage, uint8 [B, H, W]; None is 0. Needed to continue a
            simulation under law ``hazard``, where a stage lasts several ticks. ``fire_history`` returns it.
        fuel: Fuel codes of the law's fuel model, int16 [B, H, W], for law ``rate``; None takes those of the cover.
        weather: Hourly weather, as a table or its CSV file, for law ``rate``; it replaces ``wind``. Its bearings are
            from the map's north.

    Returns:
        The codes after the ticks, uint8 [B, H, W].

    Raises:
        ValueError: If a shape, type, code or number does not fit.
    """
    state, automaton, air = _start(
        cells, cover, elevation, wind, fire, ticks, first_tick, seed, cell_size, stage_age, fuel, weather
    )
    return burn(state, automaton, air, ticks).cells


@apart
def fire_history(
    cells: Tensor,
    cover: Tensor,
    elevation: Tensor | None = None,
    wind: tuple[float, float] | Wind = (0.0, 0.0),
    fire: str | Automaton = "paper",
    ticks: int = 1,
    first_tick: int = 0,
    seed: int = 0,
    cell_size: float = 30.0,
    stage_age: Tensor | None = None,
    fuel: Tensor | None = None,
    weather: WeatherTable | str | Path | None = None,
) -> FireHistory:
    """Simulate the fire as ``simulate`` does, and record when each cell ignites.

    One call simulates many fires on one map: ``cover.expand(1000, -1, -1)``.

    Args:
        cells: See ``simulate``.
        cover: See ``simulate``.
        elevation: See ``simulate``.
        wind: See ``simulate``.
        fire: See ``simulate``.
        ticks: See ``simulate``.
        first_tick: See ``simulate``.
        seed: See ``simulate``.
        cell_size: See ``simulate``.
        stage_age: See ``simulate``.
        fuel: See ``simulate``.
        weather: See ``simulate``.

    Returns:
        Arrival times, under law ``rate`` in minutes too, burning cells over time and the final codes;
        ``burn_probability()`` over the worlds, ``burned_area()`` over time.

    Raises:
        ValueError: If a shape, type, code or number does not fit.
    """
    state, automaton, air = _start(
        cells, cover, elevation, wind, fire, ticks, first_tick, seed, cell_size, stage_age, fuel, weather
    )
    return trace(state, automaton, air, ticks, cell_size)


def _start(
    cells: Tensor,
    cover: Tensor,
    elevation: Tensor | None,
    wind: tuple[float, float] | Wind,
    fire: str | Automaton,
    ticks: int,
    first_tick: int,
    seed: int,
    cell_size: float,
    stage_age: Tensor | None,
    fuel: Tensor | None,
    weather: WeatherTable | str | Path | None,
) -> tuple[WorldState, Automaton, Wind]:
    """Check the arguments; return the initial state, the fire and the wind."""
    for name, plane, top in (("cells", cells, EMBER), ("cover", cover, max(Cover)), ("stage_age", stage_age, 255)):
        if plane is None:
            continue
        if plane.dtype != torch.uint8 or plane.ndim != 3:
            raise ValueError(f"{name} must be uint8 [worlds, rows, columns], got {plane.dtype} {list(plane.shape)}")
        if plane.shape != cells.shape or plane.device != cells.device:
            raise ValueError(f"{name} must have the shape and device of cells, {list(cells.shape)} on {cells.device}")
        if plane.numel() and int(plane.max()) > top:
            raise ValueError(f"{name} must hold codes 0..{top}, got {int(plane.max())}")
    if elevation is not None and (elevation.shape != cells.shape or elevation.device != cells.device):
        raise ValueError(f"elevation must have the shape of cells, {list(cells.shape)}, got {list(elevation.shape)}")
    if elevation is not None and not bool(torch.isfinite(elevation).all()):
        raise ValueError("elevation must be finite everywhere")
    for name, number in (("ticks", ticks), ("first_tick", first_tick), ("seed", seed)):
        if number < 0:
            raise ValueError(f"{name} must be 0 or more, got {number}")
    if not 0.0 < cell_size < math.inf:
        raise ValueError(f"cell_size must be over 0 m, got {cell_size}")
    automaton = _automaton(fire)
    if stage_age is not None and int(stage_age.max()) >= automaton.ticks_per_stage:
        raise ValueError(f"stage_age must be under {automaton.ticks_per_stage} ticks, got {int(stage_age.max())}")
    elevation = None if elevation is None else elevation.to(torch.float32)
    _check_rate(automaton, first_tick, fuel, cells)
    ground = Landscape(cover, cells, elevation)
    ground = ground if fuel is None else ground.with_layers(fuel=fuel.to(torch.int16))
    air = _air(wind, weather)
    automaton = automaton.over(_Given(ground), air, cell_size)
    air = air.paced(automaton.minutes)
    state = start_burning(
        ground,
        wind=air,
        fire=automaton,
        first_tick=first_tick,
        stage_age=stage_age,
        seed=seed,
        cell_size=cell_size,
    )
    return state, automaton, air


@dataclass(frozen=True)
class _Given:
    """Given landscapes as a source."""

    landscape: Landscape

    @property
    def size(self) -> tuple[int, int]:
        return self.landscape.cover.shape[1], self.landscape.cover.shape[2]

    def __call__(self, key: Tensor) -> Landscape:
        device = self.landscape.cover.device
        return self.landscape[torch.arange(len(key), device=device) % len(self.landscape.cover)]


def _air(wind: tuple[float, float] | Wind, weather: WeatherTable | str | Path | None) -> Wind:
    """Return the wind, from weather where that is given."""
    if weather is None:
        return constant_wind(*wind) if isinstance(wind, tuple | list) else wind
    if isinstance(wind, Wind) or tuple(wind) != (0.0, 0.0):
        raise ValueError(f"wind must be left out where weather is given, got {wind}")
    return Weather(table=weather if isinstance(weather, WeatherTable) else read_weather(weather))


def _check_rate(automaton: Automaton, first_tick: int, fuel: Tensor | None, cells: Tensor) -> None:
    """Refuse inputs that law ``rate`` does not support, and fuel codes that other laws do not read."""
    if isinstance(automaton, RateFire) and first_tick > 0:
        raise ValueError(f"first_tick must be 0 under law rate, whose arrival times are not kept, got {first_tick}")
    if fuel is None:
        return
    if not isinstance(automaton, RateFire):
        raise ValueError("fuel must be left out under laws that read no fuel codes, all but rate")
    if fuel.is_floating_point() or fuel.shape != cells.shape or fuel.device != cells.device:
        raise ValueError(f"fuel must hold whole codes {list(cells.shape)}, got {fuel.dtype} {list(fuel.shape)}")


def _automaton(fire: str | Automaton) -> Automaton:
    """Return a fire, built from ``conf/fire`` if given by name."""
    if isinstance(fire, str):
        return build(plain(compose_config("train", [f"fire={fire}"]))["fire"], "fire")
    return fire
