"""The band computes the reference's bits."""

from itertools import product

import pytest
import torch

from warp_torchrl.world.air.wind import Uniform, Wandering
from warp_torchrl.world.backends.backend import Reference, fastest
from warp_torchrl.world.backends.band import AtBand
from warp_torchrl.world.law.rate import RateFire
from warp_torchrl.world.terrain.landscape import Perlin
from warp_torchrl.world.world import World

SLOW = pytest.mark.slow
AUTOMATA = {
    "usual": RateFire(model="fbp", cell_deviation=0.3, fire_deviation=0.2),
    "brief": RateFire(model="fbp", residence=0.0, wet_minutes=2.0, minutes_per_tick=2.0),
    "growing": RateFire(model="fbp", growth=True, beta=9.0, p_regrow=0.2, residence=5.0, wet_minutes=9.0),
}


WINDS = {"steady": Uniform(speed=6.0), "wandering": Wandering(speed=6.0)}
QUICK = {
    ("usual", 0.0, "steady"),
    ("brief", 0.0, "steady"),
    ("usual", 200.0, "wandering"),
    ("growing", 0.0, "wandering"),
}


@pytest.mark.parametrize(
    ("name", "relief", "wind"),
    [
        pytest.param(*case[:2], WINDS[case[2]], id="-".join(map(str, case)), marks=[] if case in QUICK else SLOW)
        for case in product(AUTOMATA, (0.0, 200.0), WINDS)
    ],
)
def test_the_band_comes_to_the_bits_of_the_reference(name: str, relief: float, wind: Uniform | Wandering) -> None:
    size = 11 if name == "brief" else 24
    world = World(fire=AUTOMATA[name], wind=wind, landscape=Perlin(size=size, relief=relief), steps_per_tick=1)
    state = world.reset(torch.arange(5), torch.zeros(5, dtype=torch.int64))
    reference, band = Reference(world.fire), AtBand(world.fire)
    generator = torch.Generator().manual_seed(0)
    for tick in range(25):
        now = torch.rand(5, generator=generator) < 0.8
        before = {leaf: value.clone() for leaf, value in state.leaves().items()}
        one, other = reference.tick(state, now).leaves(), band.tick(state, now).leaves()
        assert all(torch.equal(value, before[leaf]) for leaf, value in state.leaves().items() if "terms" not in leaf)
        differ = [leaf for leaf, value in one.items() if not torch.equal(value, other[leaf])]
        assert not differ, f"tick {tick}"
        for forecast, same in zip(reference.forecast(state), band.forecast(state), strict=True):
            assert torch.equal(forecast, same)
        state = world.step(state, torch.randint(0, 10, (5, world.team.n_agents), generator=generator)).after
    assert (state.cells > 10).any()


def test_a_cpu_takes_the_band_and_a_subclass_the_reference() -> None:
    class Own(RateFire):
        pass

    cpu = torch.device("cpu")
    assert isinstance(fastest(RateFire(), cpu), AtBand)
    assert isinstance(fastest(Own(), cpu), Reference)
    assert isinstance(fastest(RateFire(), torch.device("cuda")), Reference)
