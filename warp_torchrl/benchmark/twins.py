"""Twin experiments: fires of the same law with hidden rates and winds, which perimeters show on their way."""

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace
from statistics import median
from typing import Any

import torch
from torch import Tensor

from warp_torchrl.benchmark.tables import entry, table
from warp_torchrl.prediction.observed.correction import Corrected, Correction, ground_about
from warp_torchrl.prediction.observed.observation import Observation
from warp_torchrl.prediction.observed.scene import Scene
from warp_torchrl.world.air.weather import Weather
from warp_torchrl.world.arrays.random import log_deviation, world_key
from warp_torchrl.world.ensemble.parameters import PARAMETERS, Deviations
from warp_torchrl.world.fires.arrival_minutes import on_map
from warp_torchrl.world.fires.members import Members
from warp_torchrl.world.fires.sectors import STOPPED
from warp_torchrl.world.law.rate import RateFire
from warp_torchrl.world.state.state import Landscape
from warp_torchrl.world.weather.table import WeatherTable

CELL = 50.0
TIMES = (40.0, 70.0, 100.0, 130.0)
_SIDE, _PATCH = 71, 8  # cells of the map, and of a patch of one grass
_MEASURED = Deviations(wind_speed=0.0, moisture=0.0)
HIDDEN = {
    "rate, wind, moisture": Deviations(),
    "rate and bearing": _MEASURED,
    "rate 0.5 to 2, 30 degrees": _MEASURED,
    "uneven ground": Deviations(),
    "a held flank": Deviations(),
}
"""What each experiment hides, and how far members differ in it."""
_FORECASTS = ("free", "restart", "members", "corrected")


def scene(side: int = _SIDE, seed: int = 0) -> Scene:
    """Return a fire in patches of two kinds of grass in a west wind."""
    draws = torch.Generator().manual_seed(seed)
    patches = torch.tensor([31, 31, 32])[torch.randint(3, (side // _PATCH + 1, side // _PATCH + 1), generator=draws)]
    fuel = patches.repeat_interleave(_PATCH, 0).repeat_interleave(_PATCH, 1)[:side, :side].to(torch.int16)
    cover = torch.full((1, side, side), 2, dtype=torch.uint8)
    weather = WeatherTable(
        wind_speed=torch.tensor([3.0, 3.0]),
        wind_bearing=torch.tensor([270.0, 270.0]),
        ffmc=torch.tensor([91.0, 91.0]),
        hours=torch.tensor([0.0, 1.0]),
    )
    lit = torch.zeros(side, side, dtype=torch.bool)
    lit[side // 2, side // 3] = True
    return Scene(
        ground=Landscape(cover=cover, age=torch.full_like(cover, 10), elevation=None).with_layers(fuel=fuel[None]),
        cell_size=CELL,
        fire=RateFire(model="fbp", cell_deviation=0.1),
        air=Weather(table=weather),
        start=0.0,
        lit=lit,
    )


@dataclass(frozen=True, eq=False)
class HiddenFire:
    """A fire that nobody knows.

    Attributes:
        scene: Where it burns.
        values: Its parameters, in the order of ``PARAMETERS``, float32 [4].
        seed: Of its draws.
        factor: On its rates in each of some places, float32 [n]; None is 1.
        place: The place of each cell, int64 [H, W].
    """

    scene: Scene
    values: Tensor
    seed: int
    factor: Tensor | None = None
    place: Tensor | None = None

    def arrival(self, minutes: float) -> Tensor:
        """Return when it reaches each cell, float32 [H, W] [minutes]."""
        of, key = self.scene, world_key(torch.tensor([10_000 + self.seed]))
        fires = Members(self.values[None]).fires(of.fire, of.ground, of.spells(0.0, minutes), of.cell_size)
        if self.factor is not None:
            rate = self.values[0].exp() * self.factor[None]
            fires = replace(fires, rate=rate, sector=self.place, swiftest=max(1.0, float(rate.max())))
        return next(fires.in_parts(of.lit, key, on_map))[0]

    def pace(self, known: Tensor, minutes: float) -> float:
        """Return the rate of its head over that of the law and the weather as given, on the ground about it."""
        of = self.scene
        spell = of.spells(minutes, minutes + 1.0)[0]
        return float(Members(self.values[None]).pace(of.law, of.ground, spell, of.cell_size, ground_about(known))[0])


def hidden_fire(what: str, number: int) -> HiddenFire:
    """Return the fire of an experiment.

    Args:
        what: Of ``HIDDEN``.
        number: From 0 on.
    """
    of, draws = scene(seed=number), torch.Generator().manual_seed(100 + number)
    values = HIDDEN[what].scales * torch.randn(len(PARAMETERS), generator=draws)
    if what.startswith("rate 0.5"):
        turn = 30.0 * (-1) ** number
        values = torch.tensor([math.log(2.0) * (number % 12 / 5.5 - 1.0), 0.0, turn, 0.0])
    fire = HiddenFire(of, values, number)
    side = len(of.lit)
    rows, columns = torch.meshgrid(torch.arange(side), torch.arange(side), indexing="ij")
    if what.startswith("uneven"):
        factor = (log_deviation(0.3) * torch.randn(256, generator=draws).clamp(-2.0, 2.0)).exp()
        return replace(fire, factor=factor, place=(rows // _PATCH) * 16 + columns // _PATCH)
    if what.startswith("a held"):
        south = (fire.arrival(TIMES[-1]) > TIMES[0]) & (rows > side // 2)
        return replace(fire, factor=torch.tensor([1.0, STOPPED]), place=south.to(torch.int64))
    return fire


def perimeters(arrival: Tensor, *minutes: float) -> list[Observation]:
    """Return what is seen of a fire by its times of arrival [H, W] at some times."""
    return [Observation(minutes=each, kind="perimeter", cells=arrival <= each) for each in minutes]


def twin_experiments(names: Sequence[str], members: Sequence[int], count: int) -> list[dict[str, Any]]:
    """Return what corrected forecasts of hidden fires know after three perimeters, and how good the last one is.

    Args:
        names: Of ``HIDDEN``.
        members: Sizes of ensembles, one row for each.
        count: Fires of each experiment.
    """
    return [_row(name, size, count) for name in names for size in members]


def _row(name: str, members: int, count: int) -> dict[str, Any]:
    each = [_result(hidden_fire(name, number), HIDDEN[name], members) for number in range(count)]
    sums = {of: sum(result[of] for result in each) for of in ("rate_near", "rate_in", "pace_near", "pace_in")}
    ratios = [result["crps"] for result in each]
    briers = {of: sum(result[of] for result in each) / count for of in _FORECASTS}
    return {
        "hidden": name,
        "members": members,
        **{of: f"{total} of {count}" for of, total in sums.items()},
        "crps": median(ratios),
        "most": max(ratios),
        **briers,
    }


def _result(fire: HiddenFire, deviations: Deviations, members: int) -> dict[str, float]:
    seen = perimeters(fire.arrival(TIMES[-1]), *TIMES)
    correction = Correction(members=members, deviations=deviations, longest=0.0, seed=1000 * fire.seed)
    found: Corrected = correction(fire.scene, seen)
    third, last = found.steps[2], found.steps[3].scores
    true = {"rate": math.exp(float(fire.values[0])), "pace": fire.pace(third.burned, third.minutes)}
    known = {of: third.posterior[of] for of in true}
    return {
        **{f"{of}_near": abs(known[of][2] / value - 1.0) <= 0.2 for of, value in true.items()},
        **{f"{of}_in": known[of][0] <= value <= known[of][-1] for of, value in true.items()},
        "crps": last["corrected"].crps / last["free"].crps,
        **{of: last[of].brier for of in _FORECASTS},
    }


def twin_table(rows: Sequence[dict[str, Any]]) -> str:
    """Return the rows of ``twin_experiments`` as a table."""
    columns = [
        entry("hidden"),
        entry("members"),
        entry("rate within 20 %", "rate_near"),
        entry("in 90 %", "rate_in"),
        entry("head within 20 %", "pace_near"),
        entry("in 90 %", "pace_in"),
        entry("CRPS / free", "crps", "{:.2f}"),
        entry("at most", "most", "{:.2f}"),
        *(entry(f"Brier {name}", name, "{:.2f}") for name in _FORECASTS),
    ]
    return table(columns, rows)
