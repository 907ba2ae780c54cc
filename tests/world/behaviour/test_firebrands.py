"""Firebrands: distances as the equations have them, survival, ignition, times."""

import math

import pytest
import torch

from warp_torchrl.world.arrays.random import Stream, named_key, uniform, world_key
from warp_torchrl.world.behaviour.firebrands import FLIGHT, Firebrands, Plume, flight_minutes, ignition_chance, landing


def plume(worlds: int, intensity: float, east: float, north: float = 0.0) -> Plume:
    one = torch.ones(worlds)
    return Plume(one * intensity, one * 5.0, one * 8.0, one * east, one * north)


# I [kW/m], U [m/s]: in wind, at a strong crown fire, and a buoyant plume. mu and sigma by hand: of 10 MW/m in 10 m/s
# L = (10000 / (330 sqrt(9.81)))^(2/3) = 4.54 m, Fr = 1.50, mu = 1.32 x 1.820 x 1.288 - 0.02, sigma = 4.95 x 0.977 x
# 0.955 - 3.48; of 50 MW/m in 4 m/s Fr = 0.35, mu = 1.47 x 8.268 x 0.4665 + 1.14, sigma = 0.86 x 0.4397 x 1.840 + 0.19.
BY_HAND = {(10_000.0, 10.0): (3.075, 1.139), (30_000.0, 20.0): (4.424, 1.025), (50_000.0, 4.0): (6.810, 0.886)}


@pytest.mark.parametrize("fire", BY_HAND)
def test_distances_have_the_mean_and_the_share_beyond_100_m_of_the_equations(fire: tuple[float, float]) -> None:
    intensity, speed = fire
    mu, sigma, sideways = (each.item() for each in landing(torch.tensor(intensity), torch.tensor(speed)))
    assert (mu, sigma) == pytest.approx(BY_HAND[fire], rel=2e-3)
    key, brands = world_key(torch.arange(6250)), Firebrands(decay=1e6)
    along, across = (uniform(named_key(key, name), 0, Stream.NAMED, (16,)) for name in FLIGHT)
    flown = brands.flown(plume(6250, intensity, 0.0, speed), along, across)  # 10^5 draws
    assert flown.north.mean().item() == pytest.approx(math.exp(mu + sigma**2 / 2.0), rel=0.05)
    beyond = 0.5 * math.erfc((math.log(100.0) - mu) / sigma / math.sqrt(2.0))
    assert (flown.north > 100.0).float().mean().item() == pytest.approx(beyond, rel=0.05)
    assert abs(flown.east.mean().item()) < 0.02 * sideways and flown.east.std().item() == pytest.approx(sideways, 0.02)
    assert flown.number.sum(1).mean().item() == pytest.approx(8.0, rel=1e-2), "all glow at the end of short flights"


def test_a_share_of_one_over_e_survives_the_decay_and_calms_carry_nothing() -> None:
    middle = torch.full((1, 1), 0.5)
    brands = Firebrands(decay=math.exp(3.0752))
    flown = brands.flown(plume(1, 10_000.0, 6.0, -8.0), middle, middle)
    assert flown.number.item() == pytest.approx(8.0 / math.e, rel=1e-2)
    assert flown.east.item() == pytest.approx(0.6 * brands.decay, rel=1e-2)
    assert flown.north.item() == pytest.approx(-0.8 * brands.decay, rel=1e-2)
    still = brands.flown(plume(1, 50_000.0, 0.0), middle * 1.9, middle * 1.9)
    assert still.east.item() == 0.0 and still.north.item() == 0.0


def test_the_number_follows_the_heat_of_hot_fires() -> None:
    # 10 MW/m at 30 m/min: 60 x 10000 / 30 = 20,000 kJ/m2, on 900 m2 18 GJ.
    found = Firebrands(per_heat=2.0).number(torch.tensor([10_000.0, 1999.0]), torch.tensor(30.0), 900.0)
    assert found.tolist() == pytest.approx([36.0, 0.0])


SCHROEDER, ALBINI = [0.787092, 0.510354, 0.203191, 0.00207836], [2.640132, 0.628595, 0.246236]


def test_ignition_and_times_are_those_of_the_witness() -> None:
    """Values of pyretechnics 2026.10.20: ``schroeder_ignition_probability``, twice ``albini_t_max`` from t + 20 min."""
    assert ignition_chance(25.0, torch.tensor([3.0, 6.0, 12.0, 30.0])).tolist() == pytest.approx(SCHROEDER, rel=1e-4)
    assert flight_minutes(torch.tensor([1.0, 5.0, 20.0])).tolist() == pytest.approx(ALBINI, rel=1e-4)
    assert Firebrands(delay=7.0).minutes(plume(1, 1.0, 1.0)).item() == pytest.approx(7.0 + 2.0 * ALBINI[1], rel=1e-4)


def test_a_share_out_of_its_range_is_refused() -> None:
    with pytest.raises(ValueError, match="decay must be in"):
        Firebrands(decay=0.0)
