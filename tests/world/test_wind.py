"""Wind fields: which way the air goes, and the paper's field by hand."""

import math

import pytest
import torch
from torch import Tensor

from warp_torchrl.world.random import world_key
from warp_torchrl.world.wind import Calm, Paper, Uniform, constant_wind


def keys(worlds: int) -> Tensor:
    seed = torch.arange(worlds)
    return world_key(seed, torch.zeros_like(seed))


def test_calm_is_no_wind() -> None:
    assert Calm()(keys(3), (5, 7)).tolist() == torch.zeros(3, 2, 1, 1).tolist()


@pytest.mark.parametrize(
    ("direction", "u", "v"), [(0.0, 4.0, 0.0), (90.0, 0.0, 4.0), (180.0, -4.0, 0.0), (-45.0, 2.828427, -2.828427)]
)
def test_a_direction_is_where_the_air_goes_counted_from_east(direction: float, u: float, v: float) -> None:
    wind = Uniform(speed=4.0, direction=direction)(keys(2), (5, 7))
    assert wind.shape == (2, 2, 1, 1)
    assert wind[1].flatten().tolist() == pytest.approx([u, v], abs=1e-6)


def test_a_random_direction_is_drawn_for_each_world_all_round() -> None:
    wind = Uniform(speed=3.0)(keys(4096), (5, 7))[..., 0, 0]
    torch.testing.assert_close(wind.norm(dim=1), torch.full((4096,), 3.0))
    # Each quadrant has a quarter, 1024; 5 sigma is 139. False alarm 2e-6.
    quadrants = torch.bincount((wind[:, 0] > 0).int() * 2 + (wind[:, 1] > 0).int(), minlength=4)
    assert (quadrants - 1024).abs().max() < 139


@pytest.mark.parametrize("u, v", [(3.0, 4.0), (-2.0, 0.5), (0.0, -7.0), (0.0, 0.0)])
def test_a_constant_wind_has_the_components_it_was_given(u: float, v: float) -> None:
    assert constant_wind(u, v)(keys(1), (4, 4)).flatten().tolist() == pytest.approx([u, v], abs=1e-6)


# U = -1 - X^2 + X + Y,  V = (1 + X^2 - Y^2) / 10,  X east and Y north in [-3, 3].
PAPER_BY_HAND = {
    "centre": ((2, 3), (-1.0, 0.1)),  # X = Y = 0
    "north-west": ((0, 0), (-10.0, 0.1)),  # X = -3, Y = 3: -1 - 9 - 3 + 3
    "north-east": ((0, 6), (-4.0, 0.1)),  # X = 3, Y = 3: -1 - 9 + 3 + 3
    "south-west": ((4, 0), (-16.0, 0.1)),  # X = -3, Y = -3: -1 - 9 - 3 - 3
    "south-east": ((4, 6), (-10.0, 0.1)),  # X = 3, Y = -3: -1 - 9 + 3 - 3
    "north": ((0, 3), (2.0, -0.8)),  # X = 0, Y = 3: -1 + 3; (1 - 9) / 10
    "east": ((2, 6), (-7.0, 1.0)),  # X = 3, Y = 0: -1 - 9 + 3; (1 + 9) / 10
}


@pytest.mark.parametrize("place", PAPER_BY_HAND)
def test_the_paper_field_by_hand(place: str) -> None:
    (row, column), wanted = PAPER_BY_HAND[place]
    field = Paper()(keys(2), (5, 7))
    assert field.shape == (2, 2, 5, 7)
    assert field[1, :, row, column].tolist() == pytest.approx(wanted, abs=1e-5)


def test_the_paper_field_scales() -> None:
    torch.testing.assert_close(Paper(scale=0.5)(keys(1), (9, 6)), 0.5 * Paper()(keys(1), (9, 6)))


def test_a_rotated_field_is_the_paper_field_turned_as_a_whole() -> None:
    # The centre's vector (-1, 0.1) tells the angle; the rest must be R F(R^-1 x), worked out point by point.
    field = Paper(rotate=True)(keys(8), (5, 7))
    for world in range(8):
        u, v = field[world, :, 2, 3].tolist()
        angle = math.atan2(v, u) - math.atan2(0.1, -1.0)
        cosine, sine = math.cos(angle), math.sin(angle)
        for row, column in ((0, 0), (0, 6), (4, 0), (1, 4), (3, 2)):
            east, north = column - 3.0, 3.0 - 1.5 * row
            x, y = cosine * east + sine * north, cosine * north - sine * east
            bare_u, bare_v = -1.0 - x * x + x + y, (1.0 + x * x - y * y) / 10.0
            wanted = (cosine * bare_u - sine * bare_v, sine * bare_u + cosine * bare_v)
            assert field[world, :, row, column].tolist() == pytest.approx(wanted, abs=1e-3)


def test_each_world_has_its_own_rotation() -> None:
    centre = Paper(rotate=True)(keys(64), (5, 7))[:, :, 2, 3]
    torch.testing.assert_close(centre.norm(dim=1), torch.full((64,), math.sqrt(1.01)))
    assert centre[:, 0].unique().numel() == 64


@pytest.mark.parametrize("wind", [Calm(), Uniform(), Uniform(speed=9.0, direction=33.0), Paper(), Paper(rotate=True)])
def test_a_field_does_not_depend_on_the_batch(wind: Calm | Uniform | Paper) -> None:
    batch = wind(keys(70), (11, 6))
    for world in (0, 6, 69):
        assert torch.equal(batch[world : world + 1], wind(keys(70)[world : world + 1], (11, 6)))
