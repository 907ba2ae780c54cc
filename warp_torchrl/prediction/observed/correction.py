"""Forecasts of a fire that are corrected by each observation when its time comes.

At each observation the forecasts that were made before it are scored. Then the fire continues from what was seen: what
is inside has burned, its edge burns. Members are drawn from what their growth since the observation before says of the
fire (``posterior``).
"""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field

import torch
from torch import Tensor

from warp_torchrl.prediction.observed.observation import Observation
from warp_torchrl.prediction.observed.posterior import Posterior
from warp_torchrl.prediction.observed.scene import ByTimes, InSteps, Scene
from warp_torchrl.prediction.scores.growth import (
    STEPS,
    ForecastScores,
    GrowthScores,
    forecast_scores,
    growth_scores,
    time_between,
)
from warp_torchrl.world.arrays.random import world_key
from warp_torchrl.world.ensemble.parameters import PARAMETERS, Deviations
from warp_torchrl.world.ensemble.regression import Emulator
from warp_torchrl.world.fires.members import Members
from warp_torchrl.world.fires.sectors import sectors_about
from warp_torchrl.world.fires.sightings import Front, HotSpotSensor, Sight, hot_spot_sight, perimeter_sight
from warp_torchrl.world.state.window import Window

SHARES = (0.05, 0.25, 0.5, 0.75, 0.95)
"""Quantiles that are kept of what was learned."""
FORECASTS = ("persistence", "free", "restart", "members", "corrected")
_ABOUT = 48  # side of the ground on which the rates of heads are compared [cells]


@dataclass(frozen=True, kw_only=True)
class Correction:
    """The filter.

    Attributes:
        members: How many.
        deviations: How far they differ at first.
        sensor: The satellite that saw hot spots.
        shrinkage: Of the kernel that moves parameters, see ``filtering.jittered``.
        longest: Lead up to which forecasts are scored beyond the next observation [minutes].
        seed: Member i has seed ``seed + i``.
    """

    members: int = 100
    deviations: Deviations = field(default_factory=Deviations)
    sensor: HotSpotSensor = field(default_factory=HotSpotSensor)
    shrinkage: float = 0.97
    longest: float = 150.0
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
        run = _Run(self, scene, [each.minutes for each in observations])
        for seen in observations:
            run.add(seen)
            progress(1)
        return Corrected(run.members, run.known, observations[-1].minutes, tuple(run.steps), tuple(run.leads))


@dataclass(frozen=True, eq=False)
class Step:
    """One observation, the forecasts before it, and what was learned from it."""

    minutes: float
    lead: float  # minutes since the observation before
    kind: str
    scores: Mapping[str, ForecastScores]  # by ``FORECASTS``
    posterior: Mapping[str, Sequence[float]]  # of each parameter and of the pace of heads, quantiles ``SHARES``
    held: float  # mean probability of a sector of the front to be held
    burned: Tensor  # bool [H, W]


@dataclass(frozen=True, eq=False)
class Lead:
    """Scores of the forecasts from one observation at a later one."""

    minutes: float
    scores: Mapping[str, GrowthScores]  # by ``FORECASTS``


@dataclass(frozen=True, eq=False)
class Corrected:
    """A fire after its last observation."""

    members: Members
    burned: Tensor  # bool [H, W]
    minutes: float
    steps: tuple[Step, ...]
    leads: tuple[Lead, ...]


@dataclass(frozen=True, eq=False)
class _Pending:
    """Forecasts for an observation that is still to come."""

    begun: float
    time: float
    known: Tensor
    reached: Mapping[str, Tensor]  # float32 [H, W]


class _Run:
    """The filter on its way."""

    def __init__(self, correction: Correction, scene: Scene, times: Sequence[float]) -> None:
        self._correction, self._scene, self._times = correction, scene, times
        self._key = world_key(correction.seed + torch.arange(correction.members))
        self.known, self._since = scene.lit & scene.fuel, 0.0
        self._posterior = Posterior.prior(correction.deviations, scene.lit.shape, correction.seed)
        self.steps: list[Step] = []
        self.leads: list[Lead] = []
        self._pending: list[_Pending] = []
        self.members = self._prior()
        compared = [at for begin, end in zip((0.0, *times), times, strict=False) for at in _steps(begin, end)]
        self._free = scene.burned(self.members, self._key, self.known, (0.0, times[-1]), InSteps(compared))

    def add(self, seen: Observation) -> None:
        """Score the forecasts before an observation, and learn from it."""
        scene, sensor = self._scene, self._correction.sensor
        burned = seen.burned(self.known, sensor, sensor.side(scene.cell_size))
        front = Front(self.known, burned, scene.fuel, seen.minutes - self._since)
        sight = perimeter_sight(front)
        if seen.kind == "hot_spots":
            sight = hot_spot_sight(front, seen.cells, sensor, scene.cell_size)
        forecasts, said = self._forecasts(front, sight)
        between = time_between(front)
        scores = {name: forecast_scores(each, between, front) for name, each in forecasts.items()}
        self._score_leads(seen.minutes, burned)
        edges = scene.edge(self.known), scene.edge(burned)
        self._posterior = self._posterior.learned(self.members.values, said, sight, edges, front.minutes)
        self.known, self._since = burned, seen.minutes
        held = self._posterior.held_by_sector(sectors_about(burned), edges[1])
        tick = 1 + 2 * len(self.steps)
        values = self._posterior.drawn(self._key, tick, self._correction.shrinkage)
        local = self._correction.deviations.local
        members = Members(values).by_sector(self._key, tick, local, held, sectors_about(burned))
        self.members = scene.gusting(members, self._key)
        learned = self._learned()
        self.steps.append(Step(seen.minutes, front.minutes, seen.kind, scores, learned, float(held.mean()), burned))

    def _prior(self) -> Members:
        """Return members that learned nothing, on the fire as it was last seen."""
        members = Members.drawn(self._key, self._correction.deviations, self.known)
        return self._scene.gusting(members, self._key)

    def _learned(self) -> dict[str, list[float]]:
        """Return quantiles of the parameters, and of the pace of heads."""
        of, scene = self._posterior, self._scene
        spell = scene.spells(self._since, self._since + 1.0)[0]
        pace = self.members.pace(scene.law, scene.ground, spell, scene.cell_size, ground_about(self.known))
        emulator = Emulator.fitted(self.members.values, pace.clamp(min=1e-3).log()[:, None])
        logs = {**dict(zip(PARAMETERS, of.particles.unbind(1), strict=True)), "pace": emulator(of.particles)[0][:, 0]}
        return {
            name: of.quantiles(values.float() if name == "bearing" else values.float().exp(), SHARES)
            for name, values in logs.items()
        }

    def _forecasts(self, front: Front, sight: Sight) -> tuple[dict[str, Tensor], Tensor]:
        """Return F of each forecast until the next observation, and the growth of the members by sector.

        Forecasts of the observations after that, up to ``longest``, are kept until those come.
        """
        begin, number = self._since, len(self.steps)
        later = [each for each in self._times[number + 1 :] if each - begin <= self._correction.longest]
        end = max((begin + front.minutes, *later))
        times = [each - begin for each in (*_steps(begin, begin + front.minutes), *later)]
        counted = ByTimes(times)

        def measured(arrival: Tensor, members: Members) -> tuple[Tensor, Tensor]:
            return counted(arrival, members), sight.of(arrival)

        def burned(members: Members) -> tuple[Tensor, Tensor]:
            parts = self._scene.burned(members, self._key[: len(members)], self.known, (begin, end), measured)
            reached = torch.stack([counts for counts, _ in parts]).sum(0) / len(members)
            return reached, torch.cat([growth for _, growth in parts])

        corrected, said = burned(self.members)
        first = number * STEPS
        compared = (*range(first, first + STEPS), *(first + STEPS * (2 + n) - 1 for n in range(len(later))))
        reached = {
            "persistence": self.known.to(torch.float32).expand(len(times), -1, -1),
            "free": self._freely(compared),
            "restart": burned(Members.plain())[0],
            "members": burned(self._prior())[0] if number else corrected,
            "corrected": corrected,
        }
        for place, time in enumerate(later, STEPS):
            each = {name: planes[place].clone() for name, planes in reached.items()}
            self._pending.append(_Pending(begin, time, self.known, each))
        return {name: planes[:STEPS] for name, planes in reached.items()}, said

    def _freely(self, compared: Sequence[int]) -> Tensor:
        """Return F of the free forecast at some of its times, float32 [S, H, W]."""
        counts = [sum((part <= at).sum(0, dtype=torch.float32) for part in self._free) for at in compared]
        return torch.stack([torch.as_tensor(each) for each in counts]) / len(self._key)

    def _score_leads(self, time: float, burned: Tensor) -> None:
        """Score what was forecast of an observation before the last one."""
        due = [each for each in self._pending if each.time == time]
        self._pending = [each for each in self._pending if each.time != time]
        for each in due:
            front = Front(each.known, burned | each.known, self._scene.fuel, time - each.begun)
            scores = {name: growth_scores(chance, front) for name, chance in each.reached.items()}
            self.leads.append(Lead(time - each.begun, scores))


def _steps(begin: float, end: float) -> list[float]:
    """Return the times at which forecasts are compared between two observations."""
    return [begin + (end - begin) * number / STEPS for number in range(1, STEPS)] + [end]


def ground_about(known: Tensor) -> Window:
    """Return the ground about the middle of what has burned."""
    places, (height, width) = known.nonzero(), known.shape
    row, column = places.float().mean(0).long().tolist() if len(places) else (height // 2, width // 2)
    rows, columns = min(_ABOUT, height), min(_ABOUT, width)
    top, left = min(max(0, row - rows // 2), height - rows), min(max(0, column - columns // 2), width - columns)
    return Window(top, left, rows, columns, (height, width))
