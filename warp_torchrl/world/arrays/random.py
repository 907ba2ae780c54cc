"""Counter-based randomness: every draw is a pure function of its key, tick, stream and place.

A draw depends on (world seed, episode, tick, stream, cell), and on nothing else: not on the batch a world is in,
its place there, the device, or what was drawn before. So worlds are batch-invariant, policies that are compared on
one seed meet the same fire, nothing has to be saved, and a CUDA graph can replay it.
"""

import math
from enum import IntEnum
from zlib import crc32

import torch
from torch import Tensor

from warp_torchrl.world.arrays.compile import constant
from warp_torchrl.world.arrays.counting import counting
from warp_torchrl.world.arrays.hashing import mixed, splitmix64

_GOLDEN = -7046029254386353131  # 2^64 / golden ratio, odd, as a signed word


class Stream(IntEnum):
    """What a draw is for; two streams never share numbers."""

    FIRE = 1
    NOISE = 2
    ELEVATION = 3
    AGE = 4
    IGNITION = 5
    WIND = 6
    START = 7
    ACTION = 8
    CROP = 9
    POLICY = 10
    GUST = 11
    TERRAIN = 12
    PACE = 13
    WEATHER = 14
    AGE_IN_TENTH = 15
    LEVEL = 16
    RADIO = 17
    SENSING = 18
    SMOKE = 19
    DRIFT = 20
    LANDS = 21
    IMAGINED = 22
    NAMED = 23
    MEMBERS = 24
    SECTORS = 25
    HELD = 26


def world_key(seed: Tensor, episode: Tensor | int = 0) -> Tensor:
    """Return the key of each world's episode.

    Args:
        seed: int64 [B].
        episode: int64 [B], or one number; 0 is the first.

    Returns:
        int64 [B].
    """
    return splitmix64(splitmix64(seed * 2 + 1) + torch.as_tensor(episode, device=seed.device) * _GOLDEN)


def imagined_keys(key: Tensor, step: Tensor, count: int) -> Tensor:
    """Return keys of worlds that are imagined at a step of true ones, whose draws they do not share.

    Args:
        key: World keys, int64 [B].
        step: Agent steps, int32 [B].
        count: Keys for each world; more begin with the same ones.

    Returns:
        int64 [B, count].
    """
    word = splitmix64(_counted(key, step, Stream.IMAGINED))
    return splitmix64(word[:, None] + torch.arange(count, device=key.device) * _GOLDEN)


def named_key(key: Tensor, name: str) -> Tensor:
    """Return keys whose draws are those of a name alone, for mechanics that users add.

    Args:
        key: World keys, int64 [B].
        name: Whose draws they are.

    Returns:
        int64 [B].
    """
    return splitmix64(_counted(key, _number_of(name), Stream.NAMED))


@constant
def _number_of(name: str) -> int:
    return crc32(name.encode())


def uniform(key: Tensor, tick: Tensor | int, stream: Stream, shape: tuple[int, ...]) -> Tensor:
    """Draw uniforms in [0, 1) with 32 random bits, fine-grained near 0.

    Args:
        key: World keys, int64 [B], from ``world_key``.
        tick: Counter of the draw, int64 [B] or one number.
        stream: What the draw is for.
        shape: Shape of one world's draws.

    Returns:
        float32 [B, *shape]. Never 1, so that ``u < 1`` always holds; multiples of 2^-32 near 0, so that events of
        probability 1e-8 happen as often as they should.
    """
    return uniform_at(key, tick, stream, counting(math.prod(shape), key)[None]).view(-1, *shape)


def normal(key: Tensor, tick: Tensor | int, stream: Stream, shape: tuple[int, ...]) -> Tensor:
    """Draw standard normals, float32 [B, *shape]; arguments as of ``uniform``."""
    u = uniform(key, tick, stream, shape)
    return math.sqrt(2.0) * torch.erfinv((2.0 * u - 1.0).clamp(-1.0 + 1e-6, 1.0 - 1e-6))


def log_deviation(variation: float) -> float:
    """Return the standard deviation of the logarithm of a log-normal factor of a coefficient of variation."""
    return math.sqrt(math.log1p(variation**2))


def uniform_at(key: Tensor, tick: Tensor | int, stream: Stream, index: Tensor) -> Tensor:
    """Draw what ``uniform`` draws, at some places only.

    Args:
        key: World keys, int64 [B], from ``world_key``.
        tick: Counter of the draw, int64 [B] or one number.
        stream: What the draw is for.
        index: Flat index of each draw within a world's, int32 [B or 1, n].

    Returns:
        float32 [B, n].
    """
    low, high = _key_words(key, tick, stream)
    return mixed(index, low[:, None], high[:, None])


def uniform_among(key: Tensor, tick: Tensor | int, stream: Stream, world: Tensor, index: Tensor) -> Tensor:
    """Draw what ``uniform`` draws, at listed places of listed worlds.

    Args:
        key: World keys, int64 [B], from ``world_key``.
        tick: Counter of the draw, int64 [B] or one number.
        stream: What the draw is for.
        world: The world of each draw, int64 [n].
        index: Flat index of each draw within its world's, int32 or int64 [n] or [n, m].

    Returns:
        float32 of the shape of the index.
    """
    shape = (-1, *(1 for _ in index.shape[1:]))
    low, high = (word.index_select(0, world).view(shape) for word in _key_words(key, tick, stream))
    return mixed(index.to(torch.int32), low, high)


def _key_words(key: Tensor, tick: Tensor | int, stream: Stream) -> tuple[Tensor, Tensor]:
    """Return the two words that a world's draws are hashed with, int32 [B] each."""
    word = splitmix64(_counted(key, tick, stream))
    return word.to(torch.int32), (word >> 32).to(torch.int32)


def _counted(key: Tensor, tick: Tensor | int, stream: Stream) -> Tensor:
    counter = torch.zeros_like(key).add_(tick).mul_(64).add_(int(stream))
    return key + counter * _GOLDEN
