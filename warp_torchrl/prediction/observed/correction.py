"""Forecasts of a fire that are corrected by each observation when its time comes.

At each observation the forecasts that were made before it are scored. Then the fire continues from what was seen: what
is inside has burned, its edge burns. Members are weighed by how well they forecast the growth since the observation
before. Where few hold most of the weight, they are drawn by it and their parameters are moved
(``world.ensemble.filtering``).
"""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field

import torch
from torch import Tensor

from warp_torchrl.prediction.observed.observation import Observation
from warp_torchrl.prediction.observed.scores import ForecastScores, forecast_scores, time_between
from warp_torchrl.world.air.weather import Weather
from warp_torchrl.world.arrays.random import Stream, normal, uniform, world_key
from warp_torchrl.world.ensemble.filtering import (
    effective,
    exponent,
    jittered,
    moments,
    normalised,
    quantiles,
    resampled,
)
from warp_torchrl.world.fires.alone import on_map
from warp_torchrl.world.fires.members import PARAMETERS, Deviations, Members
from warp_torchrl.world.fires.sightings import Front, HotSpotSensor, beside, hot_spot_likelihood, perimeter_likelihood
from warp_torchrl.world.fires.spell import Spell, can_ignite, spells_of
from warp_torchrl.world.law.rate import RateFire
from warp_torchrl.world.law.travel import NEVER
from warp_torchrl.world.state.state import Landscape

STEPS = 12
"""Times at which a forecast of arrival is compared between two observations."""
ENOUGH = 0.5
"""Least effective share of the members: under it they are drawn by their weight."""
LEAST = 0.2
"""Least effective share that an observation leaves: what it says beyond that is not taken, for so few members would say
more than they can know."""
SHARES = (0.05, 0.25, 0.5, 0.75, 0.95)
"""Quantiles that are kept of what was learned."""
FORECASTS = ("persistence", "free", "restart", "members", "corrected")


@dataclass(frozen=True, kw_only=True, eq=False)
class Scene:
    """A fire and its weather.

    Attributes:
        ground: The map, batch size [1].
        cell_size: Side of a cell [m].
        fire: The law; members have rates of their own in place of its ``fire_deviation``.
        air: The weather.
        start: When the fires start, since the weather's first row began [minutes].
        lit: Where they start, bool [H, W].
    """

    ground: Landscape
    cell_size: float
    fire: RateFire
    air: Weather
    start: float
    lit: Tensor

    def spells(self, begin: float, end: float) -> list[Spell]:
        """Return the weather between two times since the start [minutes]."""
        return spells_of(self.air, end - begin, self.start + begin)


@dataclass(frozen=True, kw_only=True)
class Correction:
    """The filter.

    Attributes:
        members: How many.
        deviations: How far they differ at first.
        sensor: The satellite that saw hot spots.
        shrinkage: Of the kernel that moves parameters, see ``filtering.jittered``.
        seed: Member i has seed ``seed + i``.
    """

    members: int = 100
    deviations: Deviations = field(default_factory=Deviations)
    sensor: HotSpotSensor = field(default_factory=HotSpotSensor)
    shrinkage: float = 0.97
    seed: int = 0

    def __call__(
        self, scene: Scene, observations: Sequence[Observation], progress: Callable[[int], object] = lambda _: None
    ) -> "Corrected":
        """Return what was learned of a fire, and how well each observation was forecast.

        Args:
            scene: The fire.
            observations: In the order of time, all after the start.
            progress: Called after each observation.
        """
        run = _Run(self, scene, observations[-1].minutes)
        for seen in observations:
            run.add(seen)
            progress(1)
        return Corrected(run.members, run.weights, run.known, observations[-1].minutes, tuple(run.steps))


@dataclass(frozen=True, eq=False)
class Step:
    """One observation, the forecasts before it, and what was learned from it."""

    minutes: float
    lead: float  # minutes since the observation before
    kind: str
    scores: Mapping[str, ForecastScores]  # by ``FORECASTS``
    effective: float  # number of members after it was weighed
    drawn: bool  # whether members were drawn by their weight
    posterior: Mapping[str, Sequence[float]]  # of each parameter, quantiles ``SHARES``
    burned: Tensor  # bool [H, W]


@dataclass(frozen=True, eq=False)
class Corrected:
    """A fire after its last observation."""

    members: Members
    weights: Tensor  # float32 [K]
    burned: Tensor  # bool [H, W]
    minutes: float
    steps: tuple[Step, ...]

    def equal_members(self, seed: int) -> Members:
        """Return members of equal weight."""
        draw = uniform(world_key(torch.tensor([seed])), 0, Stream.MEMBERS, (len(PARAMETERS) + 1,))[:, -1]
        return self.members.taken(resampled(self.weights[None], draw)[0])


class _Run:
    """The filter on its way."""

    def __init__(self, correction: Correction, scene: Scene, end: float) -> None:
        self._correction, self._scene = correction, scene
        self._key = world_key(correction.seed + torch.arange(correction.members))
        self._law = scene.fire.alike()
        self.members = self._prior = Members.drawn(self._key, correction.deviations)
        self.weights = self._equal = torch.full((correction.members,), 1.0 / correction.members)
        self._fuel = can_ignite(self._law, scene.ground)
        self.known, self._since = scene.lit & self._fuel, 0.0
        self._side = correction.sensor.side(scene.cell_size)
        self._free = self._burn(self._prior, self.known, 0.0, end)
        self.steps: list[Step] = []

    def add(self, seen: Observation) -> None:
        """Score the forecasts before an observation, and learn from it."""
        burned = seen.burned(self.known, self._correction.sensor, self._side)
        front = Front(self.known, burned, self._fuel, seen.minutes - self._since)
        said, forecasts = self._forecasts(front)
        between = time_between(front)
        scores = {name: forecast_scores(each, between, front) for name, each in forecasts.items()}
        count, drawn = self._learn(said, seen, front)
        self.steps.append(Step(seen.minutes, front.minutes, seen.kind, scores, count, drawn, self.posterior(), burned))
        self.known, self._since = burned, seen.minutes

    def posterior(self) -> dict[str, list[float]]:
        """Return quantiles of the parameters that are learned."""
        each = {"rate": self.members.rate, "wind_speed": self.members.wind_speed, "bearing": self.members.bearing}
        shares = torch.tensor(SHARES)
        return {name: quantiles(of[None], self.weights[None], shares)[0].tolist() for name, of in each.items()}

    def _forecasts(self, front: Front) -> tuple[Tensor, dict[str, Tensor]]:
        """Return when each member comes [minutes since the observation before], and F of each forecast."""
        begin, end = self._since, self._since + front.minutes
        times = begin + torch.arange(1, STEPS + 1) * (front.minutes / STEPS)
        free = _reached(self._free, self._equal, times)
        persistence = self.known.to(torch.float32).expand(STEPS, -1, -1)
        if self.steps:
            said = self._burn(self.members, self.known, begin, end)
            prior = _reached(self._burn(self._prior, self.known, begin, end), self._equal, times - begin)
        else:
            said, prior = self._free, free
        one = self._burn(Members.plain(), self.known, begin, end)
        return said, {
            "persistence": persistence,
            "free": free,
            "restart": _reached(one, torch.ones(1), times - begin),
            "members": prior,
            "corrected": _reached(said, self.weights, times - begin),
        }

    def _burn(self, members: Members, lit: Tensor, begin: float, end: float) -> Tensor:
        """Return when members come [minutes since they began], float32 [K, H, W]."""
        scene = self._scene
        burning = lit & self._fuel
        found = torch.full((len(members), *lit.shape), NEVER)
        if bool(burning.any()):
            half_way = beside(lit) if begin > 0.0 else None
            fires = members.fires(self._law, scene.ground, scene.spells(begin, end), scene.cell_size, half_way)
            first = 0
            for part in fires.in_parts(burning, self._key[: len(members)], on_map):
                found[first : first + len(part)] = part
                first += len(part)
        found[:, lit] = 0.0
        return found.masked_fill_(found > end - begin, NEVER)

    def _learn(self, said: Tensor, seen: Observation, front: Front) -> tuple[float, bool]:
        """Weigh the members by an observation; return their effective number, and whether they were drawn."""
        likelihood, before = self._likelihood(said, seen, front)[None], self.weights.log()[None]
        power = exponent(before, likelihood, LEAST * len(self.members))
        weights = normalised(before + power[:, None] * likelihood)
        count = float(effective(weights))
        drawn = count < ENOUGH * len(self.members)
        if drawn:
            self._move(weights)
        else:
            self.weights = weights[0]
        return count, drawn

    def _likelihood(self, said: Tensor, seen: Observation, front: Front) -> Tensor:
        if seen.kind == "perimeter":
            return perimeter_likelihood(said, front)
        return hot_spot_likelihood(said, seen.cells, front, self._correction.sensor, self._scene.cell_size)

    def _move(self, weights: Tensor) -> None:
        """Draw the members by their weight, and move them."""
        values, tick = self.members.values[None], len(self.steps)
        draw = uniform(world_key(torch.tensor([self._correction.seed])), tick + 1, Stream.MEMBERS, (1,))[:, 0]
        taken = values.gather(1, resampled(weights, draw)[:, :, None].expand_as(values))
        noise = normal(self._key, tick + 1, Stream.MEMBERS, (values.shape[2],))[None]
        moved = jittered(taken, *moments(values, weights), noise, self._correction.shrinkage)
        self.members, self.weights = Members(moved[0]), self._equal


def _reached(arrival: Tensor, weights: Tensor, times: Tensor) -> Tensor:
    """Return the share of the members that came by some times, float32 [S, H, W]."""
    return torch.stack([torch.einsum("k,khw->hw", weights, (arrival <= time).to(torch.float32)) for time in times])
