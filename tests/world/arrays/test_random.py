"""The draws: uniform, independent, and the same wherever and whenever they are asked for.

Every seed is fixed, so a test that passes goes on passing. The rates stated are the chances that a perfect generator
would have failed it.
"""

import math

import pytest
import torch
from scipy.stats import chi2, poisson
from torch import Tensor

from warp_torchrl.world.arrays.random import Stream, named_key, uniform, uniform_at, world_key

N = 20_000_000


def keys(seeds: list[int] | range, episode: int = 0) -> Tensor:
    seed = torch.tensor(list(seeds))
    return world_key(seed, torch.full_like(seed, episode))


def largest_correlation(rows: Tensor) -> float:
    """Return the largest correlation between two of the rows, in standard errors, 1 / sqrt(n)."""
    centred = rows.to(torch.float64) - rows.to(torch.float64).mean(1, keepdim=True)
    centred /= centred.norm(dim=1, keepdim=True)
    correlation = centred @ centred.T
    return (correlation.fill_diagonal_(0.0).abs().max() * math.sqrt(rows.shape[1])).item()


@pytest.fixture(scope="module")
def draws() -> Tensor:
    return uniform(keys([21]), 7, Stream.FIRE, (N,))[0]


def test_streams_keep_their_numbers() -> None:
    # Every world that was published hangs on them.
    assert [stream.value for stream in Stream] == list(range(1, 27))


def test_the_mean_is_a_half_and_the_variance_a_twelfth(draws: Tensor) -> None:
    # Standard errors sqrt(1/12 / n) and sqrt(1/180 / n); 5 of them: false alarm 6e-7 each.
    variance, mean = torch.var_mean(draws.to(torch.float64))
    assert abs(mean - 1 / 2) < 5 * math.sqrt(1 / 12 / N)
    assert abs(variance - 1 / 12) < 5 * math.sqrt(1 / 180 / N)


def test_64_bins_are_filled_alike(draws: Tensor) -> None:
    # Chi-square with 63 degrees of freedom, too uneven or too even; false alarm 2e-6.
    counts = torch.histc(draws, bins=64, min=0.0, max=1.0).to(torch.float64)
    statistic = ((counts - N / 64) ** 2 / (N / 64)).sum().item()
    assert 1e-6 < chi2.sf(statistic, df=63) < 1 - 1e-6


@pytest.mark.parametrize("tail", [1e-6, 1e-5, 1e-4, 1e-3])
def test_draws_near_zero_are_as_many_as_they_should_be(draws: Tensor, tail: float) -> None:
    # 20, 200, 2000 and 20 000 expected; Poisson, false alarm 2e-6 each.
    low, high = poisson.interval(1 - 2e-6, N * tail)
    assert low <= (draws < tail).sum().item() <= high


def test_draws_near_zero_have_32_bits(draws: Tensor) -> None:
    near_zero = draws[draws < 2.0**-9].to(torch.float64) * 2.0**32
    assert (near_zero == near_zero.round()).all()
    # With 31 bits none would be odd; of some 39 000 half are: 5 sigma is 2.5 %.
    assert (near_zero % 2).mean().item() == pytest.approx(0.5, abs=0.0125)


def test_no_draw_is_ever_one(draws: Tensor) -> None:
    # A word in the last 2^-25 of the range rounds to 1.0 as a float32: two of these draws would, by this seed.
    assert draws.max() == 1.0 - 2.0**-24
    assert draws.min() >= 0.0


def test_neighbouring_cells_are_independent() -> None:
    # Correlation with the map shifted by each lag, standard error 1 / sqrt(n); 12 lags at 5 sigma: false alarm 7e-6.
    side = 2048
    u = uniform(keys([3]), 0, Stream.FIRE, (side, side)).flatten().to(torch.float64) - 0.5
    for lag in (1, 2, 3, 8, 64, 1024, side - 1, side, side + 1, 2 * side, 65_536, 1_000_003):
        correlation = (u[:-lag] * u[lag:]).mean().item() * 12
        assert abs(correlation) < 5 / math.sqrt(u.numel() - lag), f"lag {lag}"


def test_neighbouring_pairs_fill_the_square() -> None:
    # (u_i, u_i+1) on a 32 x 32 grid, 1023 degrees of freedom; false alarm 2e-6.
    pairs = (uniform(keys([4]), 0, Stream.FIRE, (1 << 21, 2))[0] * 32).to(torch.int64)
    counts = torch.bincount(pairs[:, 0] * 32 + pairs[:, 1], minlength=1024).to(torch.float64)
    expected = pairs.shape[0] / 1024
    statistic = ((counts - expected) ** 2 / expected).sum().item()
    assert 1e-6 < chi2.sf(statistic, df=1023) < 1 - 1e-6


# 64 rows make 2016 pairs, and the largest of as many correlations passes 6 standard errors by chance 4e-6 of the time.


def test_ticks_are_independent() -> None:
    assert largest_correlation(uniform(keys([5] * 64), torch.arange(64), Stream.FIRE, (1 << 16,))) < 6


def test_seeds_are_independent() -> None:
    assert largest_correlation(uniform(keys(range(64)), 0, Stream.FIRE, (1 << 16,))) < 6


def test_seeds_far_apart_are_independent() -> None:
    assert largest_correlation(uniform(keys([1 << bit for bit in range(62)]), 0, Stream.FIRE, (1 << 16,))) < 6


def test_episodes_are_independent() -> None:
    key = world_key(torch.full((64,), 6), torch.arange(64))
    assert largest_correlation(uniform(key, 0, Stream.FIRE, (1 << 16,))) < 6


def test_streams_are_independent() -> None:
    key = keys([7])
    assert largest_correlation(torch.cat([uniform(key, 1, stream, (1 << 16,)) for stream in Stream])) < 6


def test_streams_and_ticks_never_share_a_counter() -> None:
    assert max(Stream) < 64  # a tick is 64 counters apart from the next


@pytest.mark.parametrize("stream", [Stream.FIRE, Stream.ACTION, Stream.WIND])
def test_one_cell_over_many_seeds_is_uniform(stream: Stream) -> None:
    # Many worlds, one draw each: 64 bins over 1e6 seeds, and the correlation of a seed with the next.
    u = uniform(keys(range(1_000_000)), 0, stream, (1,))[:, 0].to(torch.float64)
    counts = torch.histc(u, bins=64, min=0.0, max=1.0)
    expected = u.numel() / 64
    assert 1e-6 < chi2.sf(((counts - expected) ** 2 / expected).sum().item(), df=63) < 1 - 1e-6
    centred = u - 0.5
    assert abs((centred[1:] * centred[:-1]).mean().item() * 12) < 5e-3


def test_keys_of_seeds_and_episodes_are_all_different() -> None:
    seed, episode = torch.meshgrid(torch.arange(-1000, 1000), torch.arange(500), indexing="ij")
    assert world_key(seed.flatten(), episode.flatten()).unique().numel() == 1_000_000


def test_no_two_worlds_draw_the_same_numbers() -> None:
    # Of 2^20 worlds, 128 pairs agree in any 32 bits of their keys: a hash of one word would draw alike for those.
    # Two draws make 2^55 combinations or so: false alarm 2e-5.
    words = uniform(keys(range(1 << 20)), 0, Stream.FIRE, (2,)).view(torch.int32).to(torch.int64)
    assert ((words[:, 0] << 32) | words[:, 1]).unique().numel() == 1 << 20


def test_a_draw_does_not_depend_on_the_batch_or_the_place_in_it() -> None:
    batch = uniform(keys(range(10, 74)), 5, Stream.FIRE, (9, 7))
    part = uniform(keys([12, 40, 10]), 5, Stream.FIRE, (9, 7))
    alone = uniform(keys([40]), 5, Stream.FIRE, (9, 7))
    assert torch.equal(part, batch[[2, 30, 0]])
    assert torch.equal(alone[0], batch[30])


def test_each_world_draws_at_its_own_tick() -> None:
    mixed = uniform(keys([1, 2]), torch.tensor([3, 900]), Stream.FIRE, (4, 4))
    assert torch.equal(mixed[:1], uniform(keys([1]), 3, Stream.FIRE, (4, 4)))
    assert torch.equal(mixed[1:], uniform(keys([2]), 900, Stream.FIRE, (4, 4)))


def test_draws_repeat_and_leave_the_global_generator_alone() -> None:
    before = torch.get_rng_state()
    first, second = (uniform(keys([8]), 2, Stream.AGE, (100,)) for _ in range(2))
    assert torch.equal(first, second)
    assert torch.equal(before, torch.get_rng_state())


def test_draws_at_some_places_are_those_of_the_whole() -> None:
    index = torch.tensor([[5, 0, 41], [7, 7, 119]], dtype=torch.int32)
    whole = uniform(keys([3, 4]), 6, Stream.POLICY, (10, 12)).flatten(1)
    assert torch.equal(uniform_at(keys([3, 4]), 6, Stream.POLICY, index), whole.gather(1, index.long()))


def test_a_name_has_draws_that_no_stream_and_no_other_name_has():
    key = world_key(torch.arange(4))
    drawn = [uniform(named_key(key, name), 0, Stream.FIRE, (8,)) for name in ("rain", "road")]
    drawn += [uniform(key, 0, stream, (8,)) for stream in Stream]
    assert len(torch.cat(drawn).unique()) == 4 * 8 * len(drawn)
    assert torch.equal(named_key(key, "rain")[2:], named_key(key[2:], "rain")), "in any batch"
