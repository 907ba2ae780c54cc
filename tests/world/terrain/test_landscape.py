"""Terrain: the shares of the covers, the laws of the noise's frequencies, the first forest."""

import pytest
import torch
from scipy.stats import chi2
from torch import Tensor

from warp_torchrl.world.arrays.random import Stream, world_key
from warp_torchrl.world.law.fire import Fire
from warp_torchrl.world.state.cells import holds_trees
from warp_torchrl.world.state.state import Cover
from warp_torchrl.world.terrain.landscape import Perlin, draw_age
from warp_torchrl.world.terrain.perlin import fractal_noise
from warp_torchrl.world.terrain.source import map_size
from warp_torchrl.world.world import World


def keys(worlds: int, first: int = 0) -> Tensor:
    seed = torch.arange(first, first + worlds)
    return world_key(seed, torch.zeros_like(seed))


def shares(cover: Tensor) -> Tensor:
    """Return the share of each of the five covers on each map, [B, 5]."""
    return torch.stack([(cover == code).float().mean((1, 2)) for code in Cover], dim=1)


@pytest.mark.parametrize("size", [16, 32, 64])
@pytest.mark.parametrize("scale", [5.0, 15.0, 50.0])
def test_quantile_thresholds_give_the_same_mixture_on_every_map(size: int, scale: float) -> None:
    # Lake 6 %, wetland 10 %, grassland 20 %, forest 64 %, each to a cell or two of rounding.
    share = shares(Perlin(size=size, scale=scale)(keys(16)).cover)
    wanted = torch.tensor([0.06, 0.10, 0.20, 0.64, 0.0]).expand(16, 5)
    torch.testing.assert_close(share, wanted, atol=2.0 / size**2, rtol=0)


def test_quantile_thresholds_hold_on_maps_that_are_not_square() -> None:
    ground = Perlin(size=(20, 50))(keys(8))
    assert ground.cover.shape == ground.age.shape == (8, 20, 50)
    wanted = torch.tensor([0.06, 0.10, 0.20, 0.64, 0.0]).expand(8, 5)
    torch.testing.assert_close(shares(ground.cover), wanted, atol=0.001, rtol=0)


def test_levels_are_cumulative_shares() -> None:
    cover = Perlin(size=20, levels=(0.25, 0.25, 0.75))(keys(4)).cover
    wanted = torch.tensor([0.25, 0.0, 0.5, 0.25, 0.0]).expand(4, 5)
    torch.testing.assert_close(shares(cover), wanted, atol=0.0026, rtol=0)


def test_minmax_thresholds_are_values_of_the_noise() -> None:
    source = Perlin(size=24, thresholds="minmax", levels=(0.3, 0.4, 0.6))
    noise, cover = source.noise(keys(4)), source(keys(4)).cover
    for n, code in zip(noise.flatten().tolist(), cover.flatten().tolist(), strict=True):
        wanted = 0 if n < 0.3 else 1 if n < 0.4 else 2 if n < 0.6 else 3
        assert code == wanted


def test_the_printed_levels_leave_no_grassland() -> None:
    # lake n < 0.01, wetland 0.01 <= n < 0.2, grassland 0.2 <= n < 0.01: nowhere, forest the rest.
    cover = Perlin(size=32, thresholds="printed", levels=(0.01, 0.2, 0.01))(keys(16)).cover
    found = shares(cover).mean(dim=0)
    assert found[Cover.GRASSLAND] == 0.0
    assert found[Cover.LAKE] > 0.0
    assert found[Cover.WETLAND] > 0.0


def test_printed_thresholds_are_the_printed_ones_by_default() -> None:
    assert shares(Perlin(thresholds="printed")(keys(4)).cover)[:, Cover.GRASSLAND].max() == 0.0


@pytest.mark.parametrize(
    ("law", "frequencies"), [("text", [1 / 8, 2 / 8, 4 / 8]), ("printed", [1 / 8, 1 / 16, 1 / 32])]
)
def test_the_frequency_laws_by_hand(law: str, frequencies: list[float]) -> None:
    # Scale 8, lacunarity 2: x 2^i / 8 by the text, x / (8 2^i) as printed; amplitudes 1, 1/2, 1/4.
    source = Perlin(size=(10, 14), scale=8.0, octaves=3, frequency_law=law)
    raw = fractal_noise(keys(3), (10, 14), frequencies, [1.0, 0.5, 0.25], Stream.NOISE)
    low, high = raw.amin((1, 2), keepdim=True), raw.amax((1, 2), keepdim=True)
    torch.testing.assert_close(source.noise(keys(3)), (raw - low) / (high - low))


def test_more_octaves_are_rougher_by_the_text_and_not_as_printed() -> None:
    def roughness(law: str) -> float:
        return Perlin(size=64, frequency_law=law).noise(keys(8)).diff(dim=2).abs().mean().item()

    assert roughness("text") > 1.5 * roughness("printed")


def test_noise_runs_from_0_to_1_on_each_map() -> None:
    noise = Perlin(size=(9, 31)).noise(keys(8))
    assert (noise.amin((1, 2)) == 0.0).all()
    assert (noise.amax((1, 2)) == 1.0).all()


def test_elevation_is_relief_times_noise() -> None:
    source = Perlin(size=32, relief=100.0)
    ground = source(keys(4))
    assert ground.elevation.dtype == torch.float32
    torch.testing.assert_close(ground.elevation, 100.0 * source.noise(keys(4)))
    highest_lake = ground.elevation.masked_fill(ground.cover != Cover.LAKE, 0.0).amax((1, 2))
    lowest_land = ground.elevation.masked_fill(ground.cover == Cover.LAKE, 100.0).amin((1, 2))
    assert (highest_lake < lowest_land).all()


def test_independent_elevation_has_hills_of_its_own() -> None:
    one, two = Perlin(relief=50.0), Perlin(relief=50.0, independent_elevation=True)
    assert torch.equal(one(keys(4)).cover, two(keys(4)).cover)
    both = torch.stack((one(keys(64)).elevation.flatten(), two(keys(64)).elevation.flatten()))
    assert torch.corrcoef(both)[0, 1].abs() < 0.3


def test_a_world_without_relief_is_flat() -> None:
    assert Perlin(relief=0.0)(keys(2)).elevation is None


def test_terrain_repeats_and_does_not_depend_on_the_batch() -> None:
    source = Perlin(size=(18, 26), relief=100.0)
    batch, alone = source(keys(16)), source(keys(1, first=11))
    for name in ("cover", "age", "elevation"):
        assert torch.equal(getattr(batch, name)[11:12], getattr(alone, name))
        assert torch.equal(getattr(batch, name), getattr(source(keys(16)), name))
    assert not torch.equal(batch.cover[0], batch.cover[1])


def test_the_first_forest_is_round_of_ten_uniforms() -> None:
    # round(10 u): 0 and 10 own half an interval, 5 %; 1..9 a whole one, 10 %. 1e6 cells, 10 degrees of freedom,
    # false alarm 2e-6.
    age = draw_age(keys(1), torch.full((1, 1000, 1000), Cover.FOREST, dtype=torch.uint8))
    counts = torch.bincount(age.flatten().to(torch.int64), minlength=11).to(torch.float64)
    expected = torch.tensor([0.05] + [0.10] * 9 + [0.05], dtype=torch.float64) * 1e6
    assert len(counts) == 11
    assert 1e-6 < chi2.sf(((counts - expected) ** 2 / expected).sum().item(), df=10) < 1 - 1e-6


@pytest.mark.parametrize("oldest", [4, 7])
def test_a_forest_of_other_ages_is_round_of_so_many_uniforms(oldest: int) -> None:
    # S_max U(0, 1), rounded: half as many of age 0 and S_max as of each other; sqrt(n p (1 - p)), 5 of them each.
    key = world_key(torch.arange(64))
    ground = Perlin(levels=(0.0, 0.0, 0.0))(key)
    age = Fire(oldest=oldest).aged(ground, key).age
    share = torch.bincount(age.flatten().long(), minlength=oldest + 1) / age.numel()
    wanted = torch.full((oldest + 1,), 1.0 / oldest)
    wanted[[0, -1]] /= 2.0
    assert len(share) == oldest + 1 and ((share - wanted).abs() < 5.0 * (wanted / age.numel()).sqrt()).all()
    assert Fire().aged(ground, key) is ground
    tenths = ground.age.float() * oldest / 10.0
    assert ((age - tenths).abs() <= 0.5 + 0.05 * oldest).all(), "each within its tenth"


def test_younger_oldest_trees_are_in_every_world() -> None:
    ages = World(landscape=Perlin(ages="oldest"), fire=Fire(oldest=3)).reset(torch.arange(2), torch.zeros(2).long())
    assert set(ages.landscape.age.unique().tolist()) == {0, 3}


def test_no_tree_stands_on_a_lake_or_on_bare_ground() -> None:
    cover = torch.arange(5, dtype=torch.uint8).expand(1, 40, 5).contiguous()
    age = draw_age(keys(1), cover)
    assert holds_trees(cover)[0, 0].tolist() == [False, True, True, True, False]
    assert (age[0].amax(dim=0) > 0).tolist() == [False, True, True, True, False]


def test_a_map_is_a_side_or_rows_and_columns() -> None:
    assert map_size(32) == (32, 32)
    assert map_size([4, 4096]) == (4, 4096)


# Parameters as ranges, drawn for each episode.

RANGES = {
    "scale": (6.0, 30.0),
    "octaves": (1, 6),
    "persistence": (0.2, 0.8),
    "lacunarity": (1.5, 2.5),
    "relief": (20.0, 80.0),
}


def test_a_range_of_one_value_is_that_value() -> None:
    fixed = Perlin(scale=9.0, octaves=3, persistence=0.4, lacunarity=1.7, relief=30.0)(keys(3))
    pairs = Perlin(scale=(9.0, 9.0), octaves=(3, 3), persistence=(0.4, 0.4), lacunarity=(1.7, 1.7), relief=(30.0, 30.0))
    assert torch.equal(pairs(keys(3)).elevation, fixed.elevation)
    assert torch.equal(pairs(keys(3)).cover, fixed.cover)


@pytest.mark.parametrize("name", RANGES)
def test_each_parameter_takes_a_range_that_each_episode_draws_from(name: str) -> None:
    # 4096 draws lie in the range and fill it: each quarter holds 1024, 5 sigma is 139. False alarm 2e-6 a parameter.
    low, high = RANGES[name]
    draws = Perlin(**{name: RANGES[name]})._draw(keys(4096), name)
    assert draws.min() >= low and draws.max() <= high
    if name == "octaves":
        counts = torch.bincount(draws.long(), minlength=7)[1:]
        assert (counts - 4096 / 6).abs().max() < 5 * (4096 * 5 / 36) ** 0.5
    else:
        quarter = ((draws - low) / (high - low) * 4).long()
        assert (torch.bincount(quarter, minlength=4) - 1024).abs().max() < 139


def test_relief_in_a_range_makes_the_height_of_each_map() -> None:
    source = Perlin(size=8, relief=(20.0, 80.0))
    highest = source(keys(64)).elevation.amax((1, 2))
    torch.testing.assert_close(highest, source._draw(keys(64), "relief").float())
    assert highest.std() > 5.0


def test_a_world_with_drawn_octaves_is_the_world_with_that_many() -> None:
    mixed = Perlin(size=12, octaves=(1, 4))
    drawn = mixed._draw(keys(16), "octaves").long()
    assert set(drawn.tolist()) == {1, 2, 3, 4}
    for octaves in (1, 4):
        # The lattices of the octaves left out still take their draws; only their weight is nought.
        frequency = torch.tensor([[2.0**octave / 15.0 for octave in range(4)]]).expand(16, 4)
        weight = torch.tensor([[0.5**octave * (octave < octaves) for octave in range(4)]]).expand(16, 4)
        raw = fractal_noise(keys(16), (12, 12), frequency, weight, Stream.NOISE, frequency[0].tolist())
        low, high = raw.amin((1, 2), keepdim=True), raw.amax((1, 2), keepdim=True)
        here = drawn == octaves
        torch.testing.assert_close(mixed.noise(keys(16))[here], ((raw - low) / (high - low))[here])


@pytest.mark.parametrize("law", ["text", "printed"])
def test_ranges_do_not_depend_on_the_batch(law: str) -> None:
    source = Perlin(size=(10, 13), frequency_law=law, **RANGES)
    many = source(keys(64))
    for world in (0, 7, 63):
        alone = source(keys(64)[world : world + 1])
        assert torch.equal(alone.elevation[0], many.elevation[world])
        assert torch.equal(alone.cover[0], many.cover[world])


def test_seven_octaves_as_the_sum_s_upper_limit_prints() -> None:
    six, seven = Perlin(size=64).noise(keys(2)), Perlin(size=64, octaves=7).noise(keys(2))
    assert not torch.allclose(six, seven)


def test_the_oldest_trees_stand_wherever_one_can() -> None:
    drawn, old = Perlin()(keys(8)), Perlin(ages="oldest")(keys(8))
    assert torch.equal(drawn.cover, old.cover) and old.age.dtype == drawn.age.dtype
    assert torch.equal(old.age, 10 * holds_trees(old.cover).to(torch.uint8)) and (drawn.age < 2).any()
