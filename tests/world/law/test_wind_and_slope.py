"""The factors of wind and slope, by hand."""

import math

import pytest
import torch
from torch import Tensor

from warp_torchrl.world.law.wind_and_slope import (
    alexandridis,
    ellipse,
    fbp,
    head_factor,
    length_to_breadth,
    slope_factor,
)

EAST, NORTH_EAST, NORTH, WEST = 2, 1, 0, 6


KERNELS = [
    lambda wind: alexandridis(wind, 0.045, 0.131),
    lambda wind: ellipse(wind, 0.16),
    lambda wind: fbp(wind, "C-7", 94.0),
]


def a_wind(u: float, v: float) -> Tensor:
    return torch.tensor([u, v])[None, :, None, None]


def test_without_wind_every_factor_is_exactly_one() -> None:
    assert torch.equal(alexandridis(a_wind(0.0, 0.0), 0.045, 0.131), torch.ones(1, 8, 1, 1))
    assert torch.equal(ellipse(a_wind(0.0, 0.0), 0.16), torch.ones(1, 8, 1, 1))
    assert torch.equal(fbp(a_wind(0.0, 0.0), "C-7", 94.0), torch.ones(1, 8, 1, 1))


def test_the_length_to_breadth_by_hand() -> None:
    # W = 18 km/h: 1 + 8.729 (1 - e^-0.54)^2.155 = 1 + 8.729 * 0.417252^2.155 = 1 + 8.729 * 0.152040 = 2.3272;
    # W = 36: 1 + 8.729 * 0.660404^2.155 = 1 + 8.729 * 0.408965 = 4.5699; at most 9.729.
    speeds = torch.tensor([0.0, 5.0, 10.0, 1000.0])
    assert length_to_breadth(speeds).tolist() == pytest.approx([1.0, 2.3272, 4.5699, 9.729], abs=2e-4)


def test_the_ellipse_by_hand() -> None:
    # 5 m/s: LB 2.3272, e = sqrt(1 - 1/2.3272^2) = 0.902974, e^(g V) = e^0.8 = 2.225541.
    # Head: 2.225541^1.67 = 3.8037. Flank: (2.225541 * 0.097026)^1.67 = 0.215935^1.67 = 0.077334.
    # Rear: (2.225541 * 0.097026 / 1.902974)^1.67 = 0.113472^1.67 = 0.026407.
    factor = ellipse(a_wind(5.0, 0.0), 0.16)[0, :, 0, 0]
    found = [factor[direction].item() for direction in (EAST, NORTH, WEST)]
    assert found == pytest.approx([3.8037, 0.077334, 0.026407], rel=1e-3)


def test_the_head_of_the_canadian_system_by_hand() -> None:
    # FFMC 94: m = 147.2 * 7 / 153.5 = 6.7127, f(F) = 91.9 e^-0.93038 (1 + 6.7127^5.31 / 4.93e7) = 36.266; ISI in calm
    # 0.208 * 36.266 = 7.5434, at 18 km/h times e^0.90702 = 2.47693: 18.6846. C-7, b 0.0305, c 2:
    # [(1 - e^-0.569881) / (1 - e^-0.230074)]^2 = (0.434408 / 0.205525)^2 = 4.4676.
    assert head_factor(torch.tensor([0.0, 5.0]), "C-7", 94.0).tolist() == pytest.approx([1.0, 4.4676], rel=1e-3)


def test_between_two_directions_a_wind_keeps_its_head() -> None:
    # The same wind of 8 m/s at 22.5 degrees: each of the two directions beside it has the half of the peak and more,
    # where the ellipse itself loses nine tenths.
    along = fbp(a_wind(8.0, 0.0), "C-7", 94.0).max()
    angle = math.pi / 8
    between = fbp(a_wind(8.0 * math.cos(angle), 8.0 * math.sin(angle)), "C-7", 94.0)[0, :, 0, 0]
    assert (between[[EAST, NORTH_EAST]] / along).tolist() == pytest.approx([0.54, 0.54], abs=0.05)


def test_the_factors_of_alexandridis_by_hand() -> None:
    # 10 m/s to the east: head exp(0.45) = 1.568312; 45 degrees exp(0.45 - 1.31 * 0.292893) = 1.068560.
    factor = alexandridis(a_wind(10.0, 0.0), 0.045, 0.131)[0, :, 0, 0]
    assert factor[EAST].item() == pytest.approx(1.568312, rel=1e-5)
    assert factor[NORTH_EAST].item() == pytest.approx(1.068560, rel=1e-5)


@pytest.mark.parametrize("kernel", KERNELS, ids=["alexandridis", "ellipse", "fbp"])
def test_the_head_s_factor_does_not_fall_with_the_wind(kernel) -> None:
    wind = torch.stack((torch.arange(0.0, 60.5, 0.5), torch.zeros(121)), dim=1)[..., None, None]
    assert (kernel(wind)[:, EAST].flatten().diff() > 0.0).all()


@pytest.mark.parametrize("kernel", KERNELS, ids=["alexandridis", "ellipse", "fbp"])
def test_factors_turn_with_the_wind_and_do_not_depend_on_the_batch(kernel) -> None:
    angle = torch.arange(64) * (math.pi / 4)
    wind = 7.0 * torch.stack((angle.cos(), angle.sin()), dim=1)[..., None, None]
    factor = kernel(wind)
    # An eighth of a turn to the left, counter-clockwise, is one direction back.
    torch.testing.assert_close(factor[1], factor[0].roll(-1, 0), rtol=1e-5, atol=0)
    for worlds in (1, 2, 7, 33):
        assert torch.equal(kernel(wind[:worlds].clone()), factor[:worlds])


def test_the_slope_of_a_direction_is_the_reciprocal_of_the_opposite_one() -> None:
    ground = torch.rand(1, 5, 6, generator=torch.Generator().manual_seed(0)) * 50.0
    factor = slope_factor(ground, 30.0, 0.078)
    # East into (2, 3) from (2, 2), and west back.
    assert (factor[0, EAST, 1 + 2, 3] * factor[0, WEST, 1 + 2, 2]).item() == pytest.approx(1.0, rel=1e-5)
