"""Options of a prediction, besides its ground and its law."""

from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Literal

from warp_torchrl.validation import check_fields
from warp_torchrl.world.fires.members import Deviations
from warp_torchrl.world.fires.sightings import HotSpotSensor


@dataclass(frozen=True, kw_only=True)
class PredictionOptions:
    """Options of ``warp predict``, besides ``landscape`` and ``fire``.

    Attributes:
        weather: CSV file of hourly weather, see ``warp_torchrl.world.weather.table``.
        ignition: File of the ignition: points, a raster or a perimeter.
        hours: Time for which fires are followed [h]; None: to the end of the weather.
        area: Area at which a fire stops, even before [ha]; None for no limit.
        fires: Number of fires.
        seed: Fire i has seed ``seed + i``.
        start: Start of the fires: minutes since the weather's first row, or a date and time.
        perimeter_hours: Hours between the perimeters that are written.
        wind_height: Height at which the wind was measured; None takes the file's.
        units: Unit of a quantity or column of the weather where the file states none, ``units.wind_speed=km/h``; of
            ``datetime`` the order of its dates, ``units.datetime=d/m/y``.
        true_north: Whether the weather's bearings are from true north, and are turned to the map's; else they are from
            the map's grid north already.
        start_ffmc: Fine fuel moisture code an hour before the first row, for a file without FFMC.
        bui: Buildup index, for a file without BUI, DMC and DC; None takes the law's.
        cell_size: Side of a cell [m]; None is that of the landscape.
        observed: File of what was seen of the fire on the way: perimeters with times (GeoJSON or a shapefile), or hot
            spots of satellites (CSV). Each corrects the prediction, which continues from the last one.
        observed_zone: Hours that the weather's rows are ahead of UTC, for times in UTC where neither rows nor file say
            it: ``observed_zone=-7``.
        members: How far fires differ before anything is seen, where something is: ``members.rate=0.4``,
            ``members.wind_speed``, ``members.bearing`` [degrees], ``members.moisture``.
        hot_spots: The satellite: ``hot_spots.pixel=375`` [m], ``hot_spots.detection``, ``hot_spots.false_alarm``,
            ``hot_spots.lately`` [h].
        animation: Whether the first fire is written as a GIF.
        out: Folder to write to; None makes one in ``outputs/predictions``.
        overwrite: Write into a folder that holds something.
        debug: Print a traceback when something fails.

    Raises:
        ValueError: If a value is out of its range, or a file is not named.
    """

    weather: str | None = None
    ignition: str | None = None
    hours: float | None = None
    area: float | None = None
    fires: int = 100
    seed: int = 0
    start: float | str = 0.0
    perimeter_hours: float = 1.0
    wind_height: Literal["10m", "20ft"] | None = None
    units: Mapping[str, str] = field(default_factory=dict)
    true_north: bool = True
    start_ffmc: float = 85.0
    bui: float | None = None
    cell_size: float | None = None
    observed: str | None = None
    observed_zone: float | None = None
    members: Deviations = field(default_factory=Deviations)
    hot_spots: HotSpotSensor = field(default_factory=HotSpotSensor)
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
            start_ffmc=(0.0, 101.0),
            bui=(0.0, 2000.0),
            cell_size=(0.01, 100_000.0),
            observed_zone=(-14.0, 14.0),
        )
        for name, what in (("weather", "a CSV file of weather"), ("ignition", "a file of where the fire starts")):
            if getattr(self, name) is None:
                raise ValueError(f"{name} must name {what}, got null")
