"""Wind over hills: theory of ridges, mass, symmetry, and a hill that was measured."""

import math

import pytest
import torch
from torch import Tensor
from torch.nn.functional import interpolate

from warp_torchrl.world.air.hills import FACTORS, Hills, bent
from warp_torchrl.world.air.mass_consistency import Mesh
from warp_torchrl.world.state.state import Landscape

FAST = Hills(layers=12, iterations=10)


def places(cells: int, side: float) -> Tensor:
    """Where the middles of cells in a row lie, about the middle of the row [m]."""
    return (torch.arange(cells) + 0.5 - cells / 2) * side


def rough(rows: int, columns: int, relief: float = 150.0) -> Tensor:
    """Hills with six knolls and hollows to each side, float32 [1, rows, columns] [m]."""
    heights = torch.rand(1, 1, 6, 6, generator=torch.Generator().manual_seed(1)) * relief
    return interpolate(heights, (rows, columns), mode="bicubic")[:, 0]


def exponential_integral(x: float) -> float:
    """E1 of a small number."""
    return -0.5772156649 - math.log(x) + x - x * x / 4.0


# Theory. Over a ridge h cos(k x) the perturbation of the first guess U(z) fades as exp(-k z), so the speed-up at the
# crest is k h times the k-weighted mean of U over the height, over U at 10 m: 1 for the same wind at all heights, where
# the wind is the potential flow, and E1(k z0) / ln(10 / z0) for a logarithmic one.


@pytest.mark.parametrize("roughness, height", [(0.0, 15.0), (0.1, 15.0), (0.1, 40.0), (0.5, 15.0)])
def test_the_speed_up_on_the_crest_of_a_cosine_ridge_is_that_of_linear_theory(roughness: float, height: float) -> None:
    cells, side = 96, 20.0
    k = 2.0 * math.pi / (cells * side / 2.0)
    ridge = height * torch.cos(k * places(cells, side))
    speed_up = Hills(roughness=roughness).factors(ridge.expand(1, 64, cells), side)[0, 0, 32, 47:49].mean() - 1.0
    mean = exponential_integral(k * roughness) / math.log(10.0 / roughness) if roughness else math.exp(-k * 10.0)
    assert float(speed_up) == pytest.approx(k * height * mean, rel=0.1)


def test_over_a_witch_of_agnesi_it_is_height_over_half_width_and_fades_above() -> None:
    height, half_width = 20.0, 300.0
    ridge = height / (1.0 + (places(96, 50.0) / half_width).square())
    crest = Hills(roughness=0.0).factors(ridge.expand(1, 96, 96), 50.0)[0, 0, 48, 47:49].mean()
    fades = (1.0 + 10.0 / half_width) ** -2
    assert float(crest) - 1.0 == pytest.approx(height / half_width * fades, rel=0.1)


def test_an_askervein_of_plain_shape_has_its_speed_up_within_a_fifth() -> None:
    # 116 m high, half of it at 220 m along the wind from 210 degrees and 900 m across, roughness 0.03 m; measured on
    # the hilltop at 10 m: 0.8 (Taylor and Teunissen 1987). The shape is a bell of these sizes, and not its contours.
    x, y = places(120, 40.0), places(120, 40.0)[:, None]
    hill = 116.0 / (1.0 + (x / 220.0).square() + (y / 900.0).square())
    assert float(Hills(roughness=0.03).factors(hill[None], 40.0)[0, 0, 59:61, 59:61].mean()) - 1.0 == pytest.approx(
        0.8, rel=0.2
    )


# Mass


def test_the_divergence_is_under_a_thousandth_of_the_wind_over_a_cell() -> None:
    mesh = Hills().mesh(rough(64, 96, 300.0), 30.0)
    assert mesh.ground.diff(dim=-1).abs().max() / 30.0 > math.tan(math.radians(25.0))
    made = mesh.divergence(Hills().wind(mesh)) / (mesh.depth * mesh.layer)
    assert float(made.abs().max()) * 30.0 < 1e-3


def test_the_gradient_is_the_transpose_of_the_divergence() -> None:
    mesh = Mesh(rough(7, 5), (30.0, 20.0), (0.1, 0.2, 0.3, 0.4), 400.0, alpha=0.6)
    field, u, v, w = (
        torch.randn(1, 2, 4, *size, generator=torch.Generator().manual_seed(2))
        for size in ((7, 5), (7, 6), (8, 5), (7, 5))
    )
    changes = mesh.gradient(field)
    halves = [torch.ones(count) for count in (6, 8)]
    for each in halves:
        each[[0, -1]] = 0.5  # of the faces at the sides
    wide, high = mesh.depth_at
    weights = (
        wide * mesh.layer * halves[0],
        high * mesh.layer * halves[1][:, None],
        mesh.depth * mesh.apart / 0.6**2,
    )
    inner = sum(
        (each * change * weight).sum() for each, change, weight in zip((u, v, w), changes, weights, strict=True)
    )
    assert float(inner) == pytest.approx(float((mesh.divergence((u, v, w)) * field).sum()), rel=1e-4)


def test_over_level_ground_the_preconditioner_is_the_solution() -> None:
    mesh = Mesh(torch.full((1, 9, 7), 50.0), (30.0, 25.0), (0.05, 0.15, 0.3, 0.5), 400.0, alpha=0.7)
    right = torch.randn(1, 2, 4, 9, 7, generator=torch.Generator().manual_seed(3))
    torch.testing.assert_close(
        mesh.divergence(mesh.gradient(mesh.over_level_ground()(right))), right, atol=1e-4, rtol=0
    )


def test_stable_air_is_lifted_less() -> None:
    def lifted(alpha: float) -> float:
        hills = Hills(alpha=alpha, layers=12)
        return float(hills.wind(hills.mesh(rough(40, 40), 30.0))[2].abs().mean())

    assert lifted(0.3) < 0.7 * lifted(1.0)


# Symmetry


def test_level_ground_leaves_a_wind_as_it_is() -> None:
    factors = FAST.factors(torch.full((2, 9, 12), 300.0), 30.0)
    expected = torch.tensor([1.0, 0.0, 0.0, 1.0])[:, None, None].expand_as(factors)
    torch.testing.assert_close(factors, expected, atol=1e-6, rtol=0)


def test_the_wind_turns_and_mirrors_with_the_ground() -> None:
    ground = rough(33, 40)
    ee, en, ne, nn = FAST.factors(ground, 30.0)[0]
    turned = FAST.factors(ground.rot90(1, (1, 2)), 30.0)[0]  # to the left: east becomes north, and north west
    expected = [each.rot90() for each in (nn, -ne, -en, ee)]
    torch.testing.assert_close(turned, torch.stack(expected), atol=2e-5, rtol=0)
    mirrored = FAST.factors(ground.flip(2), 30.0)[0]
    torch.testing.assert_close(mirrored, torch.stack((ee, -en, -ne, nn)).flip(2), atol=2e-5, rtol=0)


def test_a_ground_alone_has_the_wind_that_it_has_in_a_batch() -> None:
    grounds = torch.cat([rough(20, 24, relief) for relief in (50.0, 100.0, 150.0, 200.0, 250.0)])
    together = FAST.factors(grounds, 30.0)
    for index in range(5):
        assert torch.equal(FAST.factors(grounds[index : index + 1], 30.0), together[index : index + 1])


def test_cells_that_are_joined_change_the_wind_little() -> None:
    fine = FAST.factors(rough(64, 64), 30.0)
    coarse = Hills(layers=12, iterations=10, columns=1024).factors(rough(64, 64), 30.0)
    assert fine[:, 0].std() > 0.1 and (fine - coarse).abs().mean() < 0.03


# On landscapes


def test_a_wind_on_hills_is_the_sum_of_those_of_its_parts() -> None:
    none = torch.zeros(1, 20, 24, dtype=torch.uint8)
    ground = FAST.shaped(Landscape(none, none, rough(20, 24)), 30.0)
    factors = torch.stack([ground.layers.held[name] for name in FACTORS], dim=1)
    found = bent(torch.tensor([3.0, -2.0]).view(1, 2, 1, 1), ground)
    torch.testing.assert_close(found, 3.0 * factors[:, :2] - 2.0 * factors[:, 2:])


def test_ground_without_an_elevation_bends_no_wind() -> None:
    none = torch.zeros(1, 5, 5, dtype=torch.uint8)
    ground, wind = Landscape(none, none, None), torch.ones(1, 2, 1, 1)
    assert bent(wind, FAST.shaped(ground, 30.0)) is wind
