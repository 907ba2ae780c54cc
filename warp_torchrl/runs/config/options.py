"""Options of checkpoints, evaluations, predictions and searches."""

from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Any, Literal

from warp_torchrl.heuristics import HEURISTICS
from warp_torchrl.runs.config.seeds import BEYOND_EVALUATION, FIRST_EVALUATED
from warp_torchrl.validation import check_fields, did_you_mean
from warp_torchrl.world.air.hills import Hills
from warp_torchrl.world.behaviour.firebrands import Firebrands
from warp_torchrl.world.ensemble.parameters import Deviations
from warp_torchrl.world.fires.pieces import Gusts
from warp_torchrl.world.fires.sightings import HotSpotSensor


@dataclass(frozen=True, kw_only=True)
class CheckpointConfig:
    """Times of checkpoints.

    Attributes:
        interval: Frames between checkpoints.
        minutes: Between checkpoints by the clock, as ``SaveClock`` has it; 0: none.
        keep: Checkpoints that stay: the newest two, and of the others those of the interval.

    Raises:
        ValueError: If the interval is not positive, the minutes are negative or fewer than two are kept.
    """

    interval: int = 500_000
    minutes: float = 2.0
    keep: int = 2

    def __post_init__(self) -> None:
        check_fields(self)
        if self.interval < 1:
            raise ValueError(f"interval must be at least 1 frame, got {self.interval}")
        if not 0.0 <= self.minutes <= 1e6:
            raise ValueError(f"minutes must be in 0..1e6, where 0 saves by frames alone, got {self.minutes}")
        if not 2 <= self.keep <= 10_000:
            raise ValueError(f"keep must be in 2..10000, got {self.keep}")


@dataclass(frozen=True, kw_only=True)
class EvaluationConfig:
    """Options of evaluations.

    Attributes:
        interval: Frames between evaluations during training; 0 evaluates only at the end.
        episodes: Worlds.
        first_seed: Seed of the first; training has those below 1 000 000 and from 2^61 on.
        mode: ``sampled``, ``deterministic``, or ``best``: whichever did better on training seeds.
        baselines: Heuristics beside which the policy is shown; None: those of its worlds.
        leave_one_out: Play once more for each agent, without it, to see what it is worth.
        cache: Keep the baselines' episodes in ``~/.cache/warp_torchrl`` (or ``XDG_CACHE_HOME``), and read those kept.

    Raises:
        ValueError: If a value is out of its range or a baseline is unknown.
    """

    interval: int = 0
    episodes: int = 256
    first_seed: int = FIRST_EVALUATED
    mode: Literal["sampled", "deterministic", "best"] = "best"
    baselines: tuple[str, ...] | None = None
    leave_one_out: bool = False
    cache: bool = True

    def __post_init__(self) -> None:
        check_fields(self)
        for name in self.baselines or ():
            if name not in HEURISTICS:
                hint = did_you_mean(name, list(HEURISTICS))
                raise ValueError(f"baselines must be of {', '.join(HEURISTICS)}, got {name}{hint}")
        if self.interval < 0:
            raise ValueError(f"interval must be 0 or more frames, got {self.interval}")
        if not 1 <= self.episodes <= 1_000_000:
            raise ValueError(f"episodes must be in 1..1000000, got {self.episodes}")
        if not 0 <= self.first_seed <= BEYOND_EVALUATION - self.episodes:
            raise ValueError(
                f"first_seed must be in 0..{BEYOND_EVALUATION - self.episodes}, so that no episode has a training "
                f"world's seed, got {self.first_seed}"
            )


@dataclass(frozen=True, kw_only=True)
class PredictionOptions:
    """Options of ``warp predict``, besides ``landscape`` and ``fire``.

    Attributes:
        weather: CSV file of hourly weather, see ``warp_torchrl.world.weather.table``; a folder of rasters with a
            band an hour, see ``warp_torchrl.world.air.folder``; a netCDF file, see ``warp_torchrl.world.air.netcdf``.
        ignition: File of the ignition: points, a raster or a perimeter; points and shapes may have times, and burn from
            then on.
        barriers: File of roads, rivers and dozer lines that no flame crosses: GeoJSON or a shapefile of lines or
            polygons.
        barrier_width: Width of the lines [m], where they are wider than a cell.
        hours: Time for which fires are followed [h]; None: to the end of the weather.
        area: Area at which a fire stops, even before [ha]; None for no limit.
        fires: Number of fires.
        seed: Fire i has seed ``seed + i``.
        start: Start of the fires: minutes since the weather's first row, or a date and time; None: that of the earliest
            ignition with a time, else of the first row.
        perimeter_hours: Hours between the perimeters that are written.
        wind_height: Height at which the wind was measured; None takes the file's.
        units: Unit of a quantity or column of the weather where the file states none, ``units.wind_speed=km/h``; of
            ``datetime`` the order of its dates, ``units.datetime=d/m/y``.
        true_north: Whether the weather's bearings are from true north, and are turned to the map's; else they are from
            the map's grid north already.
        wind: ``terrain`` bends the weather's wind by hills, mass-consistently; ``weather`` takes it as given.
        hills: How hills bend it: ``hills.roughness=0.1`` [m], ``hills.alpha``, ``hills.layers``, ``hills.columns``.
        moisture: Rule of the moisture of dead fuel: ``equilibrium``, of temperature and humidity in the shade, the same
            everywhere; ``fosberg``, the tables of Fosberg and Deeming by month, hour, aspect, slope, crowns and clouds,
            cell by cell.
        season: ``date`` computes live fuel from place and date where nothing else gives it: foliar moisture and leaves
            of Canadian fuel, and by 21 days of weather before the start live moistures and curing; ``none`` leaves the
            law's.
        gusts: Whether each fire draws its wind about the mean, by the weather's gusts.
        gustiness: How: ``gustiness.minutes=10`` between draws, ``gustiness.factor``, gust over mean, for a weather
            without a column of gusts.
        start_ffmc: Fine fuel moisture code an hour before the first row, for a file without FFMC.
        bui: Buildup index, for a file without BUI, DMC and DC; None takes the law's.
        cell_size: Side of a cell [m]; None is that of the landscape.
        observed: File of what was seen of the fire on the way: perimeters with times (GeoJSON or a shapefile), or hot
            spots of satellites (CSV). Each corrects the prediction, which continues from the last one.
        observed_zone: Hours that the weather's rows are ahead of UTC, for times in UTC where neither rows nor file say
            it: ``observed_zone=-7``.
        uncertain: By what fires differ where nothing is observed: ``rate`` by the factor on all rates alone, ``all`` by
            all of ``members``, ``none`` by the law's own deviations. A single fire is that of the law as given.
        members: How far fires differ before anything is seen: ``members.rate=0.4``, ``members.wind_speed``,
            ``members.bearing`` [degrees], ``members.moisture``, ``members.local``, ``members.held``.
        hot_spots: The satellite: ``hot_spots.pixel=375`` [m], ``hot_spots.detection``, ``hot_spots.false_alarm``,
            ``hot_spots.lately`` [h].
        embers: Whether firebrands fly ahead and start fires.
        firebrands: How many, how far and how long: ``firebrands.per_heat=1`` [1/GJ], ``firebrands.least_intensity``
            [kW/m], ``firebrands.decay`` [m], ``firebrands.temperature`` [C], ``firebrands.delay`` [minutes],
            ``firebrands.followed``.
        arrivals: Whether the times of every fire are written, a band for each, as ``warp score`` reads them.
        animation: Whether the first fire is written as a GIF.
        out: Folder to write to; None makes one in ``outputs/predictions``.
        overwrite: Write into a folder that holds something.
        debug: Print a traceback when something fails.

    Raises:
        ValueError: If a value is out of its range, or a file is not named.
    """

    weather: str | None = None
    ignition: str | None = None
    barriers: str | None = None
    barrier_width: float = 0.0
    hours: float | None = None
    area: float | None = None
    fires: int = 100
    seed: int = 0
    start: float | str | None = None
    perimeter_hours: float = 1.0
    wind_height: Literal["10m", "20ft"] | None = None
    units: Mapping[str, str] = field(default_factory=dict)
    true_north: bool = True
    wind: Literal["weather", "terrain"] = "weather"
    hills: Hills = field(default_factory=Hills)
    moisture: Literal["equilibrium", "fosberg"] = "equilibrium"
    season: Literal["none", "date"] = "none"
    gusts: bool = False
    gustiness: Gusts = field(default_factory=Gusts)
    start_ffmc: float = 85.0
    bui: float | None = None
    cell_size: float | None = None
    observed: str | None = None
    observed_zone: float | None = None
    uncertain: Literal["rate", "all", "none"] = "rate"
    members: Deviations = field(default_factory=Deviations)
    hot_spots: HotSpotSensor = field(default_factory=HotSpotSensor)
    embers: bool = False
    firebrands: Firebrands = field(default_factory=Firebrands)
    arrivals: bool = False
    animation: bool = False
    out: str | None = None
    overwrite: bool = False
    debug: bool = False

    def __post_init__(self) -> None:
        check_fields(
            self,
            hours=(1e-2, 1e5),
            area=(1e-3, 1e9),
            fires=(1, 1_000_000),
            seed=(0, 2**62),
            perimeter_hours=(1e-2, 1e5),
            barrier_width=(0.0, 1e5),
            start_ffmc=(0.0, 101.0),
            bui=(0.0, 2000.0),
            cell_size=(0.01, 100_000.0),
            observed_zone=(-14.0, 14.0),
        )
        for name, what in (("weather", "a CSV file of weather"), ("ignition", "a file of where the fire starts")):
            if getattr(self, name) is None:
                raise ValueError(f"{name} must name {what}, got null")
        if self.barrier_width and self.barriers is None:
            raise ValueError(f"barrier_width is read with barriers=FILE, got {self.barrier_width:g} and no file")
        if self.firebrands != Firebrands() and not self.embers:
            raise ValueError("firebrands is read with embers=true, got embers=false")
        if self.gustiness != Gusts() and not self.gusts:
            raise ValueError("gustiness is read with gusts=true, got gusts=false")
        read = {"rate": Deviations(rate=self.members.rate), "all": self.members, "none": Deviations()}
        if self.observed is None and self.members != read[self.uncertain]:
            what = "members" if self.uncertain == "none" else "members but members.rate"
            raise ValueError(f"{what} is read with uncertain=all or observed=FILE, got uncertain={self.uncertain}")


@dataclass(frozen=True, kw_only=True)
class SearchOptions:
    """Options of ``warp search`` under ``search``.

    Attributes:
        space: Values by key of a ready search, in the grammar of Hydra's sweeps; the command line adds to them.
        fixed: Overrides of a ready search, the same in all trials.
        trials: Number of trials that are trained to their end or pruned.
        seeds: Training seeds of each trial, from ``seed`` upwards; its value is their mean.
        jobs: Number of parallel trials.
        objective: What is made best, by the goal of the scenario, as the forest saved: ``evaluation``, that of the
            trained policy on fires that no training and no other evaluation has, or ``training``, its mean over the
            last fifth of a training.
        pruner: ``median`` ends a trial that at equal frames is below the median of those before it; ``hyperband`` gives
            few of the trials many frames; ``none``.
        prune_from: Share of a training before which no trial is pruned.
        startup: Trials that are drawn at random, and by ``median`` not pruned, before the search learns from them.
        keep_training: Keep the training state in the folders of ended trials, not only their policies: for a learner
            with a replay memory up to a gigabyte each.
        seed: Seed of the search's draws.
        out: Folder to write to, or of a search to resume; None makes one in ``outputs/searches``.

    Raises:
        ValueError: If a value is out of its range.
    """

    space: Mapping[str, Any] = field(default_factory=dict)
    fixed: tuple[str, ...] = ()
    trials: int = 30
    seeds: int = 1
    jobs: int = 1
    objective: Literal["evaluation", "training"] = "evaluation"
    pruner: Literal["median", "hyperband", "none"] = "median"
    prune_from: float = 0.25
    startup: int = 6
    keep_training: bool = False
    seed: int = 0
    out: str | None = None

    def __post_init__(self) -> None:
        check_fields(
            self,
            trials=(1, 100_000),
            seeds=(1, 100),
            jobs=(1, 1000),
            prune_from=(0.0, 1.0),
            startup=(1, 10_000),
            seed=(0, 2**31),
        )
        if self.out is not None and not self.out:
            raise ValueError("out must be a folder, got ''; null makes one in outputs/searches")
        for key, values in self.space.items():
            if not isinstance(values, str):
                raise ValueError(f"space must have values in the grammar of Hydra's sweeps, got {key}: {values!r}")
