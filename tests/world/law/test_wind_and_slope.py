"""The factors of wind and slope, by hand."""

import math

import pytest
import torch
from torch import Tensor

from warp_torchrl.world.law.wind_and_slope import alexandridis, ellipse, length_to_breadth, slope_factor

EAST, NORTH_EAST, NORTH, WEST = 2, 1, 0, 6


def a_wind(u: float, v: float) -> Tensor:
    return torch.tensor([u, v])[None, :, None, None]


def test_without_wind_every_factor_is_exactly_one() -> None:
    assert torch.equal(alexandridis(a_wind(0.0, 0.0), 0.045, 0.131), torch.ones(1, 8, 1, 1))
    assert torch.equal(ellipse(a_wind(0.0, 0.0), 0.16), torch.ones(1, 8, 1, 1))


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


def test_the_factors_of_alexandridis_by_hand() -> None:
    # 10 m/s to the east: head exp(0.45) = 1.568312; 45 degrees exp(0.45 - 1.31 * 0.292893) = 1.068560.
    factor = alexandridis(a_wind(10.0, 0.0), 0.045, 0.131)[0, :, 0, 0]
    assert factor[EAST].item() == pytest.approx(1.568312, rel=1e-5)
    assert factor[NORTH_EAST].item() == pytest.approx(1.068560, rel=1e-5)


@pytest.mark.parametrize("kernel", [lambda wind: alexandridis(wind, 0.045, 0.131), lambda wind: ellipse(wind, 0.16)])
def test_the_head_s_factor_does_not_fall_with_the_wind(kernel) -> None:
    wind = torch.stack((torch.arange(0.0, 60.5, 0.5), torch.zeros(121)), dim=1)[..., None, None]
    assert (kernel(wind)[:, EAST].flatten().diff() > 0.0).all()


@pytest.mark.parametrize("kernel", [lambda wind: alexandridis(wind, 0.045, 0.131), lambda wind: ellipse(wind, 0.16)])
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
