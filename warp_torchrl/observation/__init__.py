"""What the agents see, and what the central critic sees."""

from warp_torchrl.observation.channels import CHANNELS, DEFAULT, ELEVATION_SCALE, channel
from warp_torchrl.observation.coarse import (
    PICTURE,
    PICTURE_SIDE,
    STATE,
    STATE_SIDE,
    STATE_SYMMETRY,
    central_state,
    picture,
    state_content,
    state_names,
    state_symmetry,
)
from warp_torchrl.observation.look import Look
from warp_torchrl.observation.own import SELF_SIZE, WIND_SCALE, own_vector
from warp_torchrl.observation.presets import (
    Local,
    Observation,
    Paper,
    Space,
    Surroundings,
    former_symmetry,
    searched_for,
    shows_reach,
)
from warp_torchrl.observation.view import egocentric_view

__all__ = [
    "CHANNELS",
    "DEFAULT",
    "ELEVATION_SCALE",
    "PICTURE",
    "PICTURE_SIDE",
    "SELF_SIZE",
    "STATE",
    "STATE_SIDE",
    "STATE_SYMMETRY",
    "WIND_SCALE",
    "Local",
    "Look",
    "Observation",
    "Paper",
    "Space",
    "Surroundings",
    "central_state",
    "channel",
    "egocentric_view",
    "former_symmetry",
    "own_vector",
    "picture",
    "searched_for",
    "shows_reach",
    "state_content",
    "state_names",
    "state_symmetry",
]
