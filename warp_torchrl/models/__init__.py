"""Networks over observations: encoders, and the heads of actors and critics.

They know the shapes of what they read, from a ``Signature``, how it looks when a map is turned, and nothing of the
world.
"""

from warp_torchrl.models.facing import fire_channel, given_held, hold
from warp_torchrl.models.memory import Recollection, RecurrentActor, memory_apart, recurrent_actors
from warp_torchrl.models.model import Cnn, Mlp
from warp_torchrl.models.networks import arithmetic_of
from warp_torchrl.models.signature import (
    ACTION,
    ACTION_MASK,
    ACTION_ONE_HOT,
    ACTION_VALUE,
    CHOSEN_ACTION_VALUE,
    LOG_PROB,
    LOGITS,
    MEMORY,
    OBSERVATION,
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
    "CHOSEN_ACTION_VALUE",
    "LOGITS",
    "LOG_PROB",
    "MEMORY",
    "OBSERVATION",
    "REWARD",
    "ROLE",
    "STATE",
    "STATE_ACTION_VALUE",
    "TEACHER_ACTION",
    "VALUE",
    "Cnn",
    "Entry",
    "Mlp",
    "Recollection",
    "RecurrentActor",
    "Signature",
    "arithmetic_of",
    "fire_channel",
    "given_held",
    "hold",
    "memory_apart",
    "recurrent_actors",
    "signature",
]
