"""What the agents see, and what the central critic sees."""

from warp_torchrl.env.observation.channels import CHANNELS, DEFAULT, ELEVATION_SCALE, channel
from warp_torchrl.env.observation.coarse_picture import PICTURE, PICTURE_SIDE, Blocks, picture, picture_channel
from warp_torchrl.env.observation.critic import STATE, STATE_SIDE, CriticState, state_plane
from warp_torchrl.env.observation.features import Choice, Context
from warp_torchrl.env.observation.look import Look
from warp_torchrl.env.observation.presets import (
    OF_CRITIC,
    Local,
    Observation,
    Paper,
    Space,
    Surroundings,
    critic_state,
    searched_for,
)
from warp_torchrl.env.observation.status import STATUS, WIND_SCALE, number, status_vector
from warp_torchrl.env.observation.view import egocentric_view
from warp_torchrl.env.observation.ways import way_to_fire, way_to_search, way_to_share

__all__ = [
    "CHANNELS",
    "DEFAULT",
    "ELEVATION_SCALE",
    "OF_CRITIC",
    "PICTURE",
    "PICTURE_SIDE",
    "STATE",
    "STATE_SIDE",
    "STATUS",
    "WIND_SCALE",
    "Blocks",
    "Choice",
    "Context",
    "CriticState",
    "Local",
    "Look",
    "Observation",
    "Paper",
    "Space",
    "Surroundings",
    "channel",
    "critic_state",
    "egocentric_view",
    "number",
    "picture",
    "picture_channel",
    "searched_for",
    "state_plane",
    "status_vector",
    "way_to_fire",
    "way_to_search",
    "way_to_share",
]
