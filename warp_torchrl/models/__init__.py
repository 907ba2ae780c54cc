"""Networks over observations: encoders, and the heads of actors and critics.

They know the shapes of what they read, and how it turns with the map, from a ``Signature``, and nothing of the world.
"""

from warp_torchrl.models.canonical import CanonicalBatch, over_canonical
from warp_torchrl.models.cnn import Cnn
from warp_torchrl.models.memory import (
    Recollection,
    RecurrentActor,
    RemembersApart,
    memory_apart,
    recurrent_actors,
)
from warp_torchrl.models.model import Mlp
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
    SENT,
    STATE,
    STATE_ACTION_VALUE,
    TEACHER_ACTION,
    VALUE,
    Entry,
    Signature,
    differing,
    joint,
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
    "SENT",
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
    "RemembersApart",
    "Signature",
    "arithmetic_of",
    "differing",
    "joint",
    "memory_apart",
    "over_canonical",
    "recurrent_actors",
    "signature",
]
