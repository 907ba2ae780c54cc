"""Options of ``warp score``."""

from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Literal

from warp_torchrl.validation import check_fields


@dataclass(frozen=True, kw_only=True)
class ScoreOptions:
    """Options of ``warp score``.

    Attributes:
        arrival: Raster of the times at which a predicted fire arrives, or with a band for each fire of an ensemble; or
            the folder of a prediction.
        probability: Raster of burn probability at the time of the last observation.
        observed: Files of what burned: perimeters with times (GeoJSON or a shapefile), hot spots of satellites (CSV), a
            raster of arrival, or a scar (raster, GeoJSON or a shapefile).
        hours: When a scar, or perimeters without a time, are known [h after the start]; None: at the end of all times.
        until: Time up to which the fire was predicted [h after the start]; what was seen later is left out. None: as
            long as the folder of a prediction says, else all.
        unit: Of the times of ``arrival`` where the file states none.
        begun: When the times of ``arrival`` begin [minutes after the start], as for a forecast from an observation.
        start: Start of the fire, as for ``predict``: minutes after the weather's first row, or a date and time.
        zone: Hours that the weather's rows are ahead of UTC, for times in UTC where the file states no zone.
        ignition: File of the ignition, for the null models and the first growth.
        fuel: Raster of fuel codes, for the null models.
        model: Fuel model of these codes.
        weather: CSV file of the weather, for the ellipses of its mean wind.
        units: Units of its columns that state none: ``'units={WindSpeed: km/h}'``.
        pixel: Side of a satellite's pixel [m].
        hull: Ratio of the concave hull of all hot spots so far, which is then what burned; None: the pixels about hot
            spots.
        title: Of the card; None takes the name of the first observed file's folder.
        out: Folder to write to; None makes one in ``outputs/scores``.
        overwrite: Write into a folder that holds something.
        debug: Print a traceback when something fails.

    Raises:
        ValueError: If a value is out of its range, or nothing is to be compared.
    """

    arrival: str | None = None
    probability: str | None = None
    observed: tuple[str, ...] = ()
    hours: float | None = None
    until: float | None = None
    unit: Literal["minutes", "hours"] | None = None
    begun: float = 0.0
    start: float | str = 0.0
    zone: float | None = None
    ignition: str | None = None
    fuel: str | None = None
    model: Literal["fbfm13", "fbfm40", "fbp"] = "fbfm40"
    weather: str | None = None
    units: Mapping[str, str] = field(default_factory=dict)
    pixel: float = 375.0
    hull: float | None = None
    title: str | None = None
    out: str | None = None
    overwrite: bool = False
    debug: bool = False

    def __post_init__(self) -> None:
        check_fields(
            self,
            hours=(1e-2, 1e5),
            until=(1e-2, 1e5),
            begun=(0.0, 1e7),
            zone=(-14.0, 14.0),
            pixel=(1.0, 1e5),
            hull=(0.0, 1.0),
        )
        if self.arrival is None and self.probability is None:
            raise ValueError("arrival or probability must name a raster of a predicted fire, got neither")
        if not self.observed:
            raise ValueError("observed must name a file of what burned, got none")
        if self.fuel is not None and self.ignition is None:
            raise ValueError("ignition must be given with fuel, for the null models start there, got null")
