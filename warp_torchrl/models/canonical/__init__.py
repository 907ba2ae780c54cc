"""Canonical inputs: one of the eight symmetries of the square turns agents' observations before networks read them.

``orientation`` is the group, ``entries`` and ``state`` turn what an observation declares in ``warp_torchrl.entries``,
``modules`` is the sequence of canonicalise, network and restore, ``batch`` is what is learnt from.
"""

from warp_torchrl.models.canonical.batch import CanonicalBatch
from warp_torchrl.models.canonical.entries import orientation_of, turned
from warp_torchrl.models.canonical.modules import (
    Canonicalise,
    CanonicaliseAction,
    CanonicaliseState,
    Restore,
    over_canonical,
)
from warp_torchrl.models.canonical.orientation import Orientation
from warp_torchrl.models.canonical.state import canonical_state

__all__ = [
    "CanonicalBatch",
    "Canonicalise",
    "CanonicaliseAction",
    "CanonicaliseState",
    "Orientation",
    "Restore",
    "canonical_state",
    "orientation_of",
    "over_canonical",
    "turned",
]
