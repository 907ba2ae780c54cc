"""What the agents see, and what the central critic sees."""

from warp_torchrl.observation.channels import CHANNELS, DEFAULT, ELEVATION_SCALE, Look, channel
from warp_torchrl.observation.coarse import (
    PICTURE,
    PICTURE_SIDE,
    STATE,
    STATE_SIDE,
    central_state,
    picture,
    state_names,
)
from warp_torchrl.observation.frame import Frame, can_be_held, frame_of, held, held_state
from warp_torchrl.observation.own import SELF_SIZE, WIND_SCALE, own_vector
from warp_torchrl.observation.presets import Local, Observation, Paper, Space, Surroundings
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
    "WIND_SCALE",
    "Frame",
    "Local",
    "Look",
    "Observation",
    "Paper",
    "Space",
    "Surroundings",
    "can_be_held",
    "central_state",
    "channel",
    "egocentric_view",
    "frame_of",
    "held",
    "held_state",
    "own_vector",
    "picture",
    "state_names",
]
