"""Gradient noise: what one octave is worth by hand, smooth, never zero on the lattice, the same for a key."""

import pytest
import torch
from torch import Tensor

from warp_torchrl.world.arrays.random import Stream, world_key
from warp_torchrl.world.terrain import perlin
from warp_torchrl.world.terrain.perlin import fade, fractal_noise


def keys(worlds: int, first: int = 0) -> Tensor:
    seed = torch.arange(first, first + worlds)
    return world_key(seed, torch.zeros_like(seed))


def test_the_fade_is_quintic() -> None:
    # 6/4^5 - 15/4^4 + 10/4^3 = 0.005859 - 0.058594 + 0.156250 = 0.103516; f(1 - t) = 1 - f(t).
    values = fade(torch.tensor([0.0, 0.25, 0.5, 0.75, 1.0]))
    assert values.tolist() == pytest.approx([0.0, 0.103516, 0.5, 0.896484, 1.0], abs=1e-6)


def noise_where_every_draw_is(value: float, monkeypatch: pytest.MonkeyPatch, frequency: float = 1.0) -> Tensor:
    """Return one octave over 3 x 4 cells of a lattice with one offset, and one turn of all gradients."""

    def constant(key: Tensor, tick: int, stream: Stream, shape: tuple[int, ...]) -> Tensor:
        return torch.full((key.shape[0], *shape), value)

    monkeypatch.setattr(perlin, "uniform", constant)
    return fractal_noise(keys(2), (3, 4), [frequency], [1.0], Stream.NOISE)


def test_one_octave_by_hand(monkeypatch: pytest.MonkeyPatch) -> None:
    # Offset 0.25 and a quarter turn: every gradient points along the rows' axis with length 1. A corner above the
    # cell gives t, one below t - 1, so the blend is t + f(t) (t - 1 - t) = t - f(t): 0.25 - 0.103516 = 0.146484.
    noise = noise_where_every_draw_is(0.25, monkeypatch)
    assert noise.shape == (2, 3, 4)
    assert noise.flatten().tolist() == pytest.approx([0.146484] * 24, abs=1e-6)


def test_one_octave_between_lattice_points_by_hand(monkeypatch: pytest.MonkeyPatch) -> None:
    # Half a lattice step a cell: rows at t = 0.25, 0.75, 1.25; 0.75 - f(0.75) = -0.146484.
    noise = noise_where_every_draw_is(0.25, monkeypatch, frequency=0.5)
    assert noise[1, :, 2].tolist() == pytest.approx([0.146484, -0.146484, 0.146484], abs=1e-6)


def test_an_octave_without_an_offset_would_vanish_at_lattice_points(monkeypatch: pytest.MonkeyPatch) -> None:
    assert (noise_where_every_draw_is(0.0, monkeypatch) == 0.0).all()


@pytest.mark.parametrize("frequency", [1.0, 2.0, 4.0])
def test_each_octave_is_alive_at_lattice_points(frequency: float) -> None:
    # With a whole number of lattice steps a cell, every cell is as far from the lattice as the octave's offset.
    noise = fractal_noise(keys(32), (6, 9), [frequency], [1.0], Stream.NOISE)
    assert (noise.abs() > 1e-6).float().mean() > 0.99
    assert (noise.flatten(1).std(dim=1) > 0.01).all()


def test_each_octave_has_its_own_offset_and_gradients() -> None:
    first = fractal_noise(keys(16), (8, 8), [0.3, 0.3], [1.0, 0.0], Stream.NOISE).flatten()
    second = fractal_noise(keys(16), (8, 8), [0.3, 0.3], [0.0, 1.0], Stream.NOISE).flatten()
    assert torch.corrcoef(torch.stack((first, second)))[0, 1].abs() < 0.3


def test_octaves_add_up() -> None:
    key, frequencies = keys(2), [0.1, 0.2]
    coarse = fractal_noise(key, (12, 7), frequencies, [1.0, 0.0], Stream.NOISE)
    fine = fractal_noise(key, (12, 7), frequencies, [0.0, 1.0], Stream.NOISE)
    both = fractal_noise(key, (12, 7), frequencies, [1.0, 0.5], Stream.NOISE)
    torch.testing.assert_close(both, coarse + 0.5 * fine)


def test_noise_is_continuous_across_the_lattice() -> None:
    # Along an axis each corner's ramp has slope <= 1 and the blend adds f' <= 15/8 times a difference of corners,
    # <= 2 sqrt(2): at most 6.31 a lattice step, 0.099 between cells a 64th of a step apart.
    noise = fractal_noise(keys(8), (200, 130), [1 / 64], [1.0], Stream.NOISE)
    assert noise.diff(dim=1).abs().max() < 6.31 / 64
    assert noise.diff(dim=2).abs().max() < 6.31 / 64


def test_noise_is_centred_and_the_same_along_rows_and_columns() -> None:
    # 4096 worlds, a cell each: a standard error of the mean is 1/64 of the deviation; 5 of them, false alarm 6e-7.
    noise = fractal_noise(keys(4096), (2, 2), [1.7], [1.0], Stream.NOISE)[:, 1, 1]
    assert noise.mean().abs() < 5 / 64 * noise.std()


def test_noise_is_a_function_of_key_and_stream() -> None:
    def noise(key: Tensor, stream: Stream) -> Tensor:
        return fractal_noise(key, (20, 13), [1 / 15, 2 / 15], [1.0, 0.5], stream)

    batch = noise(keys(9), Stream.NOISE)
    assert torch.equal(batch, noise(keys(9), Stream.NOISE))
    assert torch.equal(batch[4:5], noise(keys(1, first=4), Stream.NOISE))
    assert not torch.equal(batch[0], batch[1])
    assert not torch.equal(batch, noise(keys(9), Stream.ELEVATION))


@pytest.mark.parametrize("frequency", [1 / 1000, 1 / 15, 1.0, 2.0, 32.0])
def test_the_lattice_is_large_enough_for_every_offset(frequency: float) -> None:
    # An index past the lattice would raise; whole numbers of lattice steps are the tight case.
    noise = fractal_noise(keys(256), (5, 17), [frequency], [1.0], Stream.NOISE)
    assert noise.isfinite().all()
    assert noise.abs().max() < 1.5


def test_offsets_and_gradients_are_draws_of_their_own(monkeypatch: pytest.MonkeyPatch) -> None:
    asked = []

    def noted(key: Tensor, tick: int, stream: Stream, shape: tuple[int, ...]) -> Tensor:
        asked.append((tick, stream))
        return torch.full((key.shape[0], *shape), 0.25)

    monkeypatch.setattr(perlin, "uniform", noted)
    fractal_noise(keys(1), (4, 4), [0.5, 1.0], [1.0, 0.5], Stream.NOISE)
    assert asked == [(0, Stream.NOISE), (1, Stream.NOISE)]
