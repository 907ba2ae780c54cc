"""Counter-based randomness: every draw is a pure function of who asks and when.

A draw depends on (world seed, episode, tick, stream, cell), and on nothing else: not on the batch a world is in,
its place there, the device, or what was drawn before. So worlds are batch-invariant, policies that are compared on
one seed meet the same fire, nothing has to be saved, and a CUDA graph can replay it.

The integer mixers are Pelle Evensen's / Chris Wellons' published bijections: ``splitmix64`` (Steele, Lea and
Flood, 2014) for the few per-world words and a ``lowbias32``-style finaliser for the many per-cell ones. Two 32-bit
key words enter the cell hash at different rounds, so that two worlds whose first words agree still draw apart.
"""

import math
from enum import IntEnum

import torch
from torch import Tensor

from warp_torchrl.world.constants import counting
from warp_torchrl.world.fusion import kept_in_memory

_GOLDEN = -7046029254386353131  # 2^64 / golden ratio, odd, as a signed word
_SPLITMIX = (-4658895280553007687, -7723592293110705685)
_MULTIPLIERS = (0x21F0AAAD, 0xD35A2D97 - 2**32, 0x735A2D97)
_LARGEST_BELOW_ONE = 1.0 - 2.0**-24


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


def _shift_right(word: Tensor, bits: int) -> Tensor:
    """Shift a signed word of 64 bits right, filling with zeros as an unsigned one would."""
    return (word >> bits).bitwise_and_((1 << (64 - bits)) - 1)


# A compiler would write the mixer out again wherever a draw asks for its word.
@kept_in_memory("(Tensor word) -> Tensor", like=torch.empty_like)
def _splitmix64(word: Tensor) -> Tensor:
    word = (word ^ _shift_right(word, 30)) * _SPLITMIX[0]
    word = (word ^ _shift_right(word, 27)) * _SPLITMIX[1]
    return word ^ _shift_right(word, 31)


def world_key(seed: Tensor, episode: Tensor | int = 0) -> Tensor:
    """Return the key of each world's episode.

    Args:
        seed: int64 [B].
        episode: int64 [B], or one number; 0 is the first.

    Returns:
        int64 [B].
    """
    return _splitmix64(_splitmix64(seed * 2 + 1) + torch.as_tensor(episode, device=seed.device) * _GOLDEN)


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
    return _mix(index, low[:, None], high[:, None])


def uniform_among(key: Tensor, tick: Tensor | int, stream: Stream, world: Tensor, index: Tensor) -> Tensor:
    """Draw what ``uniform`` draws, at listed places of listed worlds.

    Args:
        key: World keys, int64 [B], from ``world_key``.
        tick: Counter of the draw, int64 [B] or one number.
        stream: What the draw is for.
        world: The world of each draw, int64 [n].
        index: Flat index of each draw within its world's, int64 [n].

    Returns:
        float32 [n].
    """
    low, high = _key_words(key, tick, stream)
    return _mix(index.to(torch.int32), low.index_select(0, world), high.index_select(0, world))


def _key_words(key: Tensor, tick: Tensor | int, stream: Stream) -> tuple[Tensor, Tensor]:
    """Return the two words that a world's draws are hashed with, int32 [B] each."""
    counter = torch.zeros_like(key).add_(tick).mul_(64).add_(int(stream))
    word = _splitmix64(key + counter * _GOLDEN)
    return word.to(torch.int32), (word >> 32).to(torch.int32)


def _mix(index: Tensor, low: Tensor, high: Tensor) -> Tensor:
    """Return the uniform of each index under two key words, int32 of shapes that go together."""
    bits = (index * 0x1E3779B1) ^ low  # a distinct well-mixed word for each index
    spare = torch.empty_like(bits)  # memory that was just used is several times faster than fresh memory

    def fold(shift: int) -> Tensor:
        torch.bitwise_right_shift(bits, shift, out=spare).bitwise_and_((1 << (32 - shift)) - 1)
        return bits.bitwise_xor_(spare)

    fold(16).mul_(_MULTIPLIERS[0])
    fold(15).add_(high).mul_(_MULTIPLIERS[1])
    fold(15).mul_(_MULTIPLIERS[2])
    # The word is signed: a positive one is a small number as it stands, a negative one lies half a range higher.
    fraction = fold(16).to(torch.float32).mul_(2.0**-32)
    return fraction.sub_(torch.floor(fraction, out=spare.view(torch.float32))).clamp_(max=_LARGEST_BELOW_ONE)
