"""Options of a calibration, besides the law."""

from collections.abc import Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any, Literal

from warp_torchrl.prediction.calibration.evolution import Evolution
from warp_torchrl.prediction.calibration.fitting import FittingMethod
from warp_torchrl.prediction.calibration.gradients import Gradients
from warp_torchrl.prediction.calibration.losses import Loss
from warp_torchrl.validation import check_fields


@dataclass(frozen=True, kw_only=True)
class CalibrationOptions:
    """Options of ``warp calibrate``, besides ``fire``.

    Attributes:
        fires: Folders of real fires, see ``warp_torchrl.prediction.calibration.case.read_fire_case``.
        hours: When their scars are known [h]; None is the end of each one's weather.
        hours_by_fire: The same of single fires, by the names of their folders: ``hours_by_fire.clinge=3``.
        units: Unit of a quantity or column of their weather where files state none, ``units.wind_speed=km/h``; for
            ``datetime`` the order of its dates, ``units.datetime=d/m/y``.
        height_unit: Metres per unit of their canopies' heights where files state none: 0.1 for LANDFIRE.
        density_unit: kg/m3 per unit of their canopies' bulk densities, the same: 0.01 for LANDFIRE.
        parameters: Parameters to fit, see ``prediction.calibration.parameters``; none scores the law without a fit.
        bounds: Lowest and highest value by parameter; default: the usual ones.
        scales: Deviation of the prior by parameter; default: the usual ones.
        method: ``gradients`` or ``evolution``.
        loss: Loss of the fit; None is ``cross_entropy`` for gradients, ``jaccard`` for evolution.
        prior_weight: Weight of the priors against the mean loss of the fires.
        steps: Steps of gradients or generations of evolution; None is 8 or 15.
        population: Candidates of each generation.
        softness: Deviation of the logarithm of a fire's rates in the expected burning of gradients.
        leave_one_out: Whether each fire of two or more is left out in turn, and scored by a law fitted to the others;
            the fit then keeps the share that is best on fires left out, or nothing.
        draws: Fires that are run for each score.
        seed: Of all draws.
        out: Folder to write to; None makes one in ``outputs/calibrations``.
        overwrite: Write into a folder that holds something.
        debug: Print a traceback when something fails.

    Raises:
        ValueError: If a value is out of its range, or values do not go together.
    """

    fires: tuple[str, ...] = ()
    hours: float | None = None
    hours_by_fire: Mapping[str, float] = field(default_factory=dict)
    units: Mapping[str, str] = field(default_factory=dict)
    height_unit: float | None = None
    density_unit: float | None = None
    parameters: tuple[str, ...] = ()
    bounds: Mapping[str, Any] = field(default_factory=dict)
    scales: Mapping[str, Any] = field(default_factory=dict)
    method: Literal["gradients", "evolution"] = "gradients"
    loss: Loss | None = None
    prior_weight: float = 0.1
    steps: int | None = None
    population: int = 8
    softness: float = 0.2
    leave_one_out: bool = True
    draws: int = 64
    seed: int = 1
    out: str | None = None
    overwrite: bool = False
    debug: bool = False

    def __post_init__(self) -> None:
        check_fields(self, height_unit=(1e-3, 10.0), density_unit=(1e-3, 10.0))
        check_fields(self, hours=(1e-2, 1e5), draws=(1, 100_000), steps=(1, 10_000))
        if not self.fires:
            raise ValueError("fires must name folders of fires that happened, got none")
        names = [Path(each).name for each in self.fires]
        for name, hours in self.hours_by_fire.items():
            if name not in names:
                raise ValueError(f"hours_by_fire must name some of {', '.join(names)}, got {name}")
            if isinstance(hours, bool) or not isinstance(hours, int | float) or not 1e-2 <= hours <= 1e5:
                raise ValueError(f"hours_by_fire.{name} must be in [0.01, 100000], got {hours!r}")
        _ = self.fit  # refuse what it refuses

    def hours_of(self, folder: str) -> float | None:
        """Return when the scar of a fire's folder is known [h]; None at the end of its weather."""
        return self.hours_by_fire.get(Path(folder).name, self.hours)

    @property
    def fit(self) -> FittingMethod:
        """Return the method with its options."""
        if self.method == "gradients":
            return Gradients(
                steps=self.steps or 8,
                loss=self.loss or "cross_entropy",
                softness=self.softness,
                prior_weight=self.prior_weight,
            )
        return Evolution(
            generations=self.steps or 15,
            population=self.population,
            loss=self.loss or "jaccard",
            prior_weight=self.prior_weight,
            seed=self.seed,
        )
