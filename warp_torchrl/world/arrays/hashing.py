"""The integer mixers of draws.

They are Pelle Evensen's / Chris Wellons' published bijections: ``splitmix64`` (Steele, Lea and
Flood, 2014) for the few per-world words and a ``lowbias32``-style finaliser for the many per-cell ones. Two 32-bit
key words enter the cell hash at different rounds, so that two worlds whose first words agree still draw apart.
"""

import torch
from torch import Tensor

from warp_torchrl.world.arrays.compile import opaque_op

_SPLITMIX = (-4658895280553007687, -7723592293110705685)
_MULTIPLIERS = (0x21F0AAAD, 0xD35A2D97 - 2**32, 0x735A2D97)
_LARGEST_BELOW_ONE = 1.0 - 2.0**-24


def _shift_right(word: Tensor, bits: int) -> Tensor:
    """Shift a signed word of 64 bits right, filling with zeros as an unsigned one would."""
    return (word >> bits).bitwise_and_((1 << (64 - bits)) - 1)


# A compiler would write the mixer out again wherever a draw asks for its word.
@opaque_op("(Tensor word) -> Tensor", like=torch.empty_like)
def splitmix64(word: Tensor) -> Tensor:
    """Return each word mixed, int64, shape of the input."""
    word = (word ^ _shift_right(word, 30)) * _SPLITMIX[0]
    word = (word ^ _shift_right(word, 27)) * _SPLITMIX[1]
    return word ^ _shift_right(word, 31)


def mixed(index: Tensor, low: Tensor, high: Tensor) -> Tensor:
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
