"""Every fast backend computes what the law does, to the bit."""

from collections.abc import Callable
from dataclasses import dataclass
from itertools import product

import pytest
import torch
from torch import Tensor

from tests.world.drawing import differing
from warp_torchrl.world.air.wind import Calm, Paper, Uniform, Wandering, Wind
from warp_torchrl.world.arrays.random import Stream, uniform, uniform_among
from warp_torchrl.world.backends.backend import Reference, fastest
from warp_torchrl.world.backends.edge import AtEdge
from warp_torchrl.world.backends.join import in_place
from warp_torchrl.world.backends.planes import WholeMaps
from warp_torchrl.world.backends.rows import probability_from_rows
from warp_torchrl.world.backends.table import table_in
from warp_torchrl.world.backends.tick import advance
from warp_torchrl.world.law.fire import Fire, Gains
from warp_torchrl.world.law.hazard import HazardFire
from warp_torchrl.world.state.state import WorldState
from warp_torchrl.world.terrain.landscape import Perlin
from warp_torchrl.world.world import World

ALONE = {
    "paper": Fire(),
    "unit": Fire(diagonal="unit", kernel="ellipse", alpha=(0.3, 0.1, 1.0, 0.8, 0.2)),
    "four": Fire(burning_stages=5, neighbours=4, wind_gain=0.3),  # gains over 1 / alpha, which are clipped
    "hazard": HazardFire(refinement=3, wet_ticks=2),
}
WHOLE = {
    "growth": Fire(growth=True, tau=1.0),
    "few ages and stages": Fire(growth=True, tau=1.0, beta=60.0, oldest=4, burning_stages=2),
    "lightning": Fire(beta=60.0),
    "regrowth": Fire(p_regrow=0.2),
    "all": HazardFire(growth=True, beta=90.0, p_regrow=0.3, refinement=2, youngest_fuel=1),
}
WINDS = {"calm": Calm(), "uniform": Uniform(speed=7.0), "wandering": Wandering(), "field": Paper()}
RELIEFS = {"level": 0.0, "slopes": 300.0}


def cases(fires: dict[str, Fire], quick: Callable[[int, int, int], bool]) -> list[object]:
    """Return each automaton on each relief in each wind, slow but for the quick ones of their three numbers."""
    return [
        pytest.param(
            fires[fire],
            RELIEFS[relief],
            WINDS[wind],
            marks=[] if quick(f, r, w) else [pytest.mark.slow],
            id=f"{wind}-{relief}-{fire}",
        )
        for (f, fire), (r, relief), (w, wind) in product(*map(enumerate, (fires, RELIEFS, WINDS)))
    ]


def burning(fire: Fire, relief: float, wind: Wind, ticks: int = 7) -> list[WorldState]:
    """Return six worlds as they are before each of some ticks, the third of which waits."""
    world = World(landscape=Perlin(size=(11, 13), relief=relief), fire=fire, wind=wind)
    states, ticks_now = [world.reset(torch.arange(6), torch.zeros(6, dtype=torch.int64))], torch.arange(6) != 2
    for _ in range(ticks):
        wet = torch.where(states[-1].cells == 5, 3, states[-1].wet).to(torch.uint8)
        states.append(advance(states[-1].replace(wet=wet), fire, world.air, ticks_now))
    return states


def whole_map(state: WorldState) -> Tensor:
    return uniform(state.key, state.tick, Stream.FIRE, tuple(state.cells.shape[1:]))


# In the quick suite each automaton meets both reliefs; one that burns alone meets all winds too, on one relief each.


@pytest.mark.parametrize(
    ("fire", "relief", "wind"),
    [
        *cases(ALONE, lambda fire, relief, wind: (fire + wind) % 2 == relief),
        *cases(WHOLE, lambda fire, relief, wind: (fire + relief) % len(WINDS) == wind),
    ],
)
def test_planes_come_to_what_the_law_does(fire: Fire, relief: float, wind: Wind) -> None:
    lit, ticks_now = 0, torch.arange(6) != 4
    for state in burning(fire, relief, wind):
        q = fire.ignition_probability(state)
        expected, probability = WholeMaps(fire).forecast(state)
        assert torch.equal(probability, q) and torch.equal(expected, fire.expected_ignitions(state))
        after = fire.tick(state, whole_map(state), ticks_now)
        for each in (Reference(fire), WholeMaps(fire), fastest(fire, state.cells.device)):
            assert differing(each.tick(state, ticks_now), after) == []
        lit += int((q > 0.0).sum())
    assert lit > 100


@pytest.mark.parametrize(
    ("fire", "relief", "wind"), cases(ALONE, lambda fire, relief, wind: (fire + wind) % 2 != relief)
)
def test_the_edge_comes_to_what_the_law_does(fire: Fire, relief: float, wind: Wind) -> None:
    listed, ticks_now = 0, torch.arange(6) != 4
    for state in burning(fire, relief, wind):
        at_edge, draws = AtEdge(fire), whole_map(state)
        edge = at_edge.edge(state)
        at_trees = uniform_among(state.key, state.tick, Stream.FIRE, edge.world, edge.place)
        assert torch.equal(at_trees, edge.of(draws))
        assert differing(at_edge.tick(state, ticks_now), fire.tick(state, draws, ticks_now)) == []
        expected, probability = at_edge.forecast(state)
        assert torch.equal(expected, fire.expected_ignitions(state))
        assert torch.equal(probability, fire.ignition_probability(state))
        listed += len(edge.cell)
    assert listed > 300


@pytest.mark.parametrize("fire", ALONE.values(), ids=ALONE)
def test_rows_come_to_what_the_table_does(fire: Fire) -> None:
    for state in burning(fire, 0.0, Uniform(speed=7.0), ticks=5):
        assert table_in(state) is not None
        without = state.replace(air=state.air.replace(terms=Gains(state.air.terms.gain)))
        q = WholeMaps(fire).ignition_probability(without)
        assert torch.equal(WholeMaps(fire).ignition_probability(state), q)
        made = probability_from_rows(
            in_place(fire.law),
            fire.spreads(state),
            in_place(fire.law).susceptibility(state.alpha) * fire.is_fuel(state),
            fire.gain(state.wind),
            None,
            fire.directions,
        )
        assert torch.equal(made, q)


@dataclass(frozen=True, kw_only=True)
class Certain(Fire):
    """Every tree ignites beside any fire: a law of another form."""

    def spread_probability(self, state: WorldState) -> Tensor:
        """Return 1 for each tree beside fire, float32 [B, H, W]."""
        return (super().spread_probability(state) > 0.0).to(torch.float32)


def test_an_automaton_with_rules_of_its_own_takes_the_reference() -> None:
    fire = Certain()
    world = World(landscape=Perlin(size=12), fire=fire, wind=Calm(), steps_per_tick=1)
    state = world.reset(torch.arange(4), torch.zeros(4, dtype=torch.int64))
    assert table_in(state) is None
    beside = Fire().ignition_probability(state) > 0.0
    assert torch.equal(world.forecast(state).ignition_probability, beside.to(torch.float32)) and beside.any()
    after = world.step(state, torch.full((4, world.team.n_agents), 10)).after
    assert torch.equal((after.cells == 11), beside | (state.cells == 11) & (after.cells == 11))
