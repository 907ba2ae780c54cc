"""Networks over observations: encoders, and the heads of actors and critics.

They know the shapes of what they read, and how it turns with the map, from a ``Signature``, and nothing of the world.
"""

from warp_torchrl.models.canonical import CanonicalBatch, over_canonical
from warp_torchrl.models.memory import Recollection, RecurrentActor, memory_apart, recurrent_actors
from warp_torchrl.models.model import Cnn, Mlp
from warp_torchrl.models.networks import arithmetic_of
from warp_torchrl.models.signature import (
    ACTION,
    ACTION_MASK,
    ACTION_ONE_HOT,
    ACTION_VALUE,
    AGENCY,
    CANONICAL,
    CANONICAL_STATE,
    CHOSEN_ACTION_VALUE,
    LOG_PROB,
    LOGITS,
    MEMORY,
    OBSERVATION,
    ORIENTATION,
    RADIO,
    REWARD,
    ROLE,
    STATE,
    STATE_ACTION_VALUE,
    TEACHER_ACTION,
    VALUE,
    Entry,
    Signature,
    signature,
)

__all__ = [
    "ACTION",
    "ACTION_MASK",
    "ACTION_ONE_HOT",
    "ACTION_VALUE",
    "AGENCY",
    "CANONICAL",
    "CANONICAL_STATE",
    "CHOSEN_ACTION_VALUE",
    "LOGITS",
    "LOG_PROB",
    "MEMORY",
    "OBSERVATION",
    "ORIENTATION",
    "RADIO",
    "REWARD",
    "ROLE",
    "STATE",
    "STATE_ACTION_VALUE",
    "TEACHER_ACTION",
    "VALUE",
    "CanonicalBatch",
    "Cnn",
    "Entry",
    "Mlp",
    "Recollection",
    "RecurrentActor",
    "Signature",
    "arithmetic_of",
    "memory_apart",
    "over_canonical",
    "recurrent_actors",
    "signature",
]
