"""Options of law ``rate``: fuels, moistures, and factors on the rates."""

from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from functools import cached_property
from typing import Any, Literal, Self

from warp_torchrl.validation import check_fields
from warp_torchrl.world.behaviour.crown import CrownModel
from warp_torchrl.world.behaviour.fbp_fuels import CURING
from warp_torchrl.world.behaviour.moistures import moisture_row
from warp_torchrl.world.law.automaton import Automaton
from warp_torchrl.world.law.fuel_bed import COVER_FUEL, FuelBed
from warp_torchrl.world.law.mapped_fuel import check_fuel, has_own_table, told_fuel
from warp_torchrl.world.state.state import Landscape
from warp_torchrl.world.terrain.source import LandscapeSource


@dataclass(frozen=True, kw_only=True)
class RateOptions(Automaton):
    """The options of law ``rate``, and the fuels that they describe.

    Attributes:
        model: Fuel models: ``fbfm13`` (Anderson 1982), ``fbfm40`` (Scott and Burgan 2005) or ``fbp`` (Canadian).
        fuel_models: Fuel models of one's own by code, in place of those of ``model``: each a mapping of the fields of
            ``behaviour.fuel_models.FuelModel``.
        minutes_per_tick: Minutes of a tick; None takes half of what the fastest fire needs for a cell of the landscape.
        residence: Minutes that a cell burns at least.
        wet_minutes: Minutes for which a tree that was put out cannot ignite.
        moisture: Percent by name, of those that the wind tells nothing of: see ``moistures.MOISTURES``.
        fuel_of_cover: Fuel code of lake, wetland, grassland, forest and bare ground, for landscapes without fuel codes;
            None takes those of ``fuel_bed.COVER_FUEL``. Where given, the codes of a landscape with a table of the
            user's own are classes of land cover, and the fuel is that of their cover.
        fuel_gain: Factor on the rate of each fuel code that it names.
        rate_gain: Factor on all rates.
        wind_gain: Factor on the wind's speed.
        slope_gain: Factor on the slope's tangent.
        crown: Rule of the rate of crown fire in Rothermel's fuels, ``cruz`` or ``rothermel`` (see ``behaviour.crown``),
            where the landscape has canopy cover, height, base height and bulk density; ``none`` for surface fire alone.
        foliar_moisture: Water in the needles of crowns [% of dry weight]; None takes 100 in Rothermel's fuels and 97 in
            Canadian ones.
        curing: Cured grass of the Canadian O-1 [%]; None takes 80. Of Rothermel's fuels ``moisture.live_herbaceous``
            says it.
        green: Whether the leaves of aspen are out in Canadian fuels: whether 13 is D-2, 60 M-2 and 90 M-4; None: no.
        percent_conifer: Conifers in the Canadian M-1 and M-2 whose code does not say it [%].
        percent_dead_fir: Dead balsam fir in the Canadian M-3 and M-4 whose code does not say it [%].
        grass_load: Fuel in Canadian grass [kg/m2].
        acceleration: Whether fires from a point take time to reach their rates (see ``behaviour.acceleration``).
            Predictions and calibrations read it; worlds that step refuse it.
        cell_deviation: Coefficient of variation of the rates from cell to cell.
        fire_deviation: Coefficient of variation of the rates from fire to fire.

    Raises:
        ValueError: If a value is out of its range.
    """

    youngest_fuel: int = 1
    model: Literal["fbfm13", "fbfm40", "fbp"] = "fbfm40"
    fuel_models: Mapping[int, Any] = field(default_factory=dict)
    minutes_per_tick: float | None = None
    residence: float = 20.0
    wet_minutes: float = 60.0
    moisture: Mapping[str, float] = field(default_factory=dict)
    fuel_of_cover: tuple[int, int, int, int, int] | None = None
    fuel_gain: Mapping[int, float] = field(default_factory=dict)
    rate_gain: float = 1.0
    wind_gain: float = 1.0
    slope_gain: float = 1.0
    crown: CrownModel = "cruz"
    foliar_moisture: float | None = None
    curing: float | None = None
    green: bool | None = None
    percent_conifer: float = 50.0
    percent_dead_fir: float = 35.0
    grass_load: float = 0.35
    acceleration: bool = False
    cell_deviation: float = 0.1
    fire_deviation: float = 0.0
    _by_cover: bool = field(default=False, init=False, repr=False)
    _wind_wanders: bool = field(default=False, init=False, repr=False)

    def __post_init__(self) -> None:
        super().__post_init__()
        check_fields(
            self,
            minutes_per_tick=(1e-3, 1440.0),
            residence=(0.0, 1e5),
            wet_minutes=(0.0, 1e5),
            rate_gain=(0.0, 100.0),
            wind_gain=(0.0, 10.0),
            slope_gain=(0.0, 10.0),
            foliar_moisture=(20.0, 400.0),
            curing=(0.0, 100.0),
            percent_conifer=(0.0, 100.0),
            percent_dead_fir=(0.0, 100.0),
            grass_load=(0.0, 100.0),
            cell_deviation=(0.0, 2.0),
            fire_deviation=(0.0, 2.0),
        )
        _ = moisture_row(self.moisture), self.bed  # refuse what they do not know

    @cached_property
    def bed(self) -> FuelBed:
        """Return the fuels with their factors."""
        return FuelBed(
            model=self.model,
            fuel_models=self.fuel_models,
            fuel_of_cover=COVER_FUEL[self.model] if self.fuel_of_cover is None else tuple(self.fuel_of_cover),
            fuel_gain=self.fuel_gain,
            rate_gain=self.rate_gain,
            wind_gain=self.wind_gain,
            slope_gain=self.slope_gain,
            crown=self.crown,
            foliar_moisture=self.foliar_moisture,
            curing=CURING if self.curing is None else self.curing,
            green=bool(self.green),
            percent_conifer=self.percent_conifer,
            percent_dead_fir=self.percent_dead_fir,
            grass_load=self.grass_load,
            by_cover=self._by_cover,
        )

    def on(self, landscape: LandscapeSource) -> Self:
        """Return the law on a landscape, which says whether its codes are fuels or classes of land cover.

        Raises:
            ValueError: If the fuel codes of the landscape are of another model, or the model lacks some.
        """
        law = self._changed(_by_cover=self.fuel_of_cover is not None and has_own_table(landscape))
        law.bed.check(landscape)
        return law

    def check_fuel(self, landscape: Landscape) -> None:
        """Refuse landscapes with fuel codes that the model lacks.

        Raises:
            ValueError: With codes and cells.
        """
        check_fuel(self.bed.fuel(landscape), self.bed.table, "fire.fuel_models" if self.fuel_models else self.model)

    def told_fuel(self, landscape: Landscape) -> str:
        """Return in words how many cells of landscapes have each fuel, and which are no fuel."""
        return told_fuel(self.bed.fuel(landscape), self.bed.table)

    def alike(self) -> Self:
        """Return the law under which fires differ from cell to cell alone."""
        return self._changed(fire_deviation=0.0)

    def with_state(self, **state: Any) -> Self:
        """Return the law with another state of its fuel: ``curing``, ``green``, ``foliar_moisture``."""
        return self._changed(**state)

    @property
    def wind_wanders(self) -> bool:
        """Return whether the wind of the worlds changes with every tick."""
        return self._wind_wanders

    def _changed(self, **changes: Any) -> Self:
        """Return the law with other values. ``_by_cover`` and ``_wind_wanders`` stay unless they are given."""
        marks = {name: changes.pop(name, getattr(self, name)) for name in ("_by_cover", "_wind_wanders")}
        law = replace(self, **changes)
        for name, value in marks.items():
            object.__setattr__(law, name, value)
        law.__dict__.pop("bed")  # made without the marks
        return law
