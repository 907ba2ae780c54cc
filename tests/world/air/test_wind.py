"""Wind fields: which way the air goes, and the paper's field by hand."""

import math

import pytest
import torch
from torch import Tensor

from tests.world.drawing import draw
from warp_torchrl.world.air.wind import Calm, Paper, Uniform, Wandering, constant_wind
from warp_torchrl.world.arrays.random import Stream, uniform, world_key
from warp_torchrl.world.backends.tick import advance, in_wind
from warp_torchrl.world.law.fire import Fire


def keys(worlds: int) -> Tensor:
    seed = torch.arange(worlds)
    return world_key(seed, torch.zeros_like(seed))


def test_calm_is_no_wind() -> None:
    assert Calm()(keys(3), (5, 7)).tolist() == torch.zeros(3, 2, 1, 1).tolist()


def test_components_are_the_nearest_float32_ones_whatever_device_computes_them() -> None:
    angles = (uniform(keys(4096), 0, Stream.WIND, (1,))[:, 0] * (2.0 * math.pi)).tolist()
    expected = torch.tensor([[math.cos(angle), math.sin(angle)] for angle in angles], dtype=torch.float32)
    assert torch.equal(Uniform(speed=1.0)(keys(4096), (5, 7))[..., 0, 0], expected)


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


def test_fields_are_rotated_alike_to_all_sides() -> None:
    # 4096 worlds: the mean of a unit vector, and that of one of twice the angle, is 0 +- 1 / (64 sqrt 2) in each
    # component; five of them, false alarm 2e-6.
    u, v = Paper(rotate=True)(keys(4096), (5, 7))[:, :, 2, 3].unbind(1)
    angle = torch.atan2(v, u)
    for times in (1, 2):
        mean = torch.stack(((times * angle).cos().mean(), (times * angle).sin().mean()))
        assert mean.abs().max() < 5 / (64 * math.sqrt(2))


def test_each_world_has_its_own_rotation() -> None:
    centre = Paper(rotate=True)(keys(64), (5, 7))[:, :, 2, 3]
    torch.testing.assert_close(centre.norm(dim=1), torch.full((64,), math.sqrt(1.01)))
    assert centre[:, 0].unique().numel() == 64


@pytest.mark.parametrize("wind", [Calm(), Uniform(), Uniform(speed=9.0, direction=33.0), Paper(), Paper(rotate=True)])
def test_a_field_does_not_depend_on_the_batch(wind: Calm | Uniform | Paper) -> None:
    batch = wind(keys(70), (11, 6))
    for world in (0, 6, 69):
        assert torch.equal(batch[world : world + 1], wind(keys(70)[world : world + 1], (11, 6)))


# A wind that wanders.


def wander(wind: Wandering, worlds: int, ticks: int) -> tuple[Tensor, Tensor]:
    """Return speed [m/s] and direction [radians] of each world after each tick, [T + 1, B]."""
    state = draw("....", worlds=worlds)
    field = wind(state.key, (1, 4))
    fields = [field]
    for tick in range(1, ticks + 1):
        state = in_wind(state, Fire(), fields[-1]).replace(tick=torch.full_like(state.tick, tick))
        fields.append(wind.after_tick(state))
    u, v = torch.stack(fields)[..., 0, 0].unbind(2)
    return torch.hypot(u, v), torch.atan2(v, u)


def test_a_wandering_wind_is_an_ornstein_uhlenbeck_process() -> None:
    # 1024 worlds. Speed 6 + N(0, 1.5^2), direction 0 + N(0, 20 degrees): standard errors of mean, deviation and
    # correlation are deviation / 32, deviation / 45.3 and at most 1 / 32; five of them each, false alarm under 1e-5.
    wind = Wandering(speed=6.0, direction=0.0, speed_deviation=1.5, direction_deviation=20.0, memory=10.0)
    speed, direction = wander(wind, 1024, 30)
    degrees = torch.rad2deg(direction)
    for tick in (0, 1, 30):  # stationary from the start
        assert speed[tick].mean().item() == pytest.approx(6.0, abs=5 * 1.5 / 32)
        assert speed[tick].std().item() == pytest.approx(1.5, abs=5 * 1.5 / 45.3)
        assert degrees[tick].mean().item() == pytest.approx(0.0, abs=5 * 20 / 32)
        assert degrees[tick].std().item() == pytest.approx(20.0, abs=5 * 20 / 45.3)
    for lag in (1, 10, 30):  # exp(-lag / memory)
        for process in (speed, degrees):
            found = torch.corrcoef(torch.stack((process[0], process[lag])))[0, 1].item()
            assert found == pytest.approx(math.exp(-lag / 10.0), abs=5 / 32)
    assert torch.corrcoef(torch.stack((speed[9], degrees[9])))[0, 1].abs() < 5 / 32


def test_without_deviations_it_blows_as_a_uniform_one() -> None:
    wandering = Wandering(speed=3.0, speed_deviation=0.0, direction_deviation=0.0)
    speed, direction = wander(wandering, 32, 5)
    uniform = Uniform(speed=3.0)(draw("....", worlds=32).key, (1, 4))
    torch.testing.assert_close(wandering(draw("....", worlds=32).key, (1, 4)), uniform)
    torch.testing.assert_close(speed, torch.full_like(speed, 3.0))
    turned = torch.remainder(direction[5] - direction[0] + math.pi, 2 * math.pi) - math.pi
    assert turned.abs().max() < 1e-4


def test_a_wandering_wind_turns_through_west_without_a_jump() -> None:
    # About 180 degrees the angle changes its sign; the wind's own course must not notice.
    east = Wandering(direction=0.0, memory=50.0, direction_deviation=40.0)
    west = Wandering(direction=180.0, memory=50.0, direction_deviation=40.0)
    (_, one), (_, other) = wander(east, 256, 40), wander(west, 256, 40)
    difference = torch.remainder(other - one, 2 * math.pi) - math.pi
    assert difference.abs().max() < 1e-3


def test_a_wandering_wind_never_dies_nor_storms() -> None:
    speed, _ = wander(Wandering(speed=0.0, speed_deviation=20.0, memory=0.1), 1024, 20)
    assert speed.min() >= 1e-3 - 1e-6 and speed.max() <= 60.0 + 1e-4


def test_a_wandering_wind_does_not_depend_on_the_batch() -> None:
    speed, direction = wander(Wandering(), 64, 10)
    for worlds in (1, 7):
        alone_speed, alone_direction = wander(Wandering(), worlds, 10)
        assert torch.equal(alone_speed, speed[:, :worlds]) and torch.equal(alone_direction, direction[:, :worlds])


@pytest.mark.parametrize("wind", [Calm(), Uniform(), Paper()])
def test_other_winds_stay(wind) -> None:
    state = in_wind(draw("...."), Fire(), wind(keys(1), (1, 4)))
    assert not wind.changes
    assert wind.after_tick(state) is state.wind


def test_a_wandering_wind_waits_with_a_world_that_is_not_due() -> None:
    fire, wind, state = Fire(), Wandering(), draw("....", worlds=2)
    state = in_wind(state, fire, wind(state.key, (1, 4)))
    after = advance(state, fire, wind, torch.tensor([True, False]))
    assert not torch.equal(after.wind[0], state.wind[0])
    assert torch.equal(after.wind[1], state.wind[1])
