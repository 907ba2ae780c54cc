"""Metrics of an episode, as fractions in 0..1."""

import torch
from torch import Tensor

from warp_torchrl.world.state.state import TreeCounts, WorldState
from warp_torchrl.world.world import World

METRICS = (
    "saved",
    "burned",
    "extinguished",
    "cleared",
    "burning",
    "burning_area",
    "control_time",
    "actions",
    "redundant",
    "success",
)
"""Names of the metrics, in the order of tables."""
SAVED_BY = "saved_"
"""Of agencies, before the name of each: ``saved_agency_0``."""
SUCCESS_LEVEL = 0.6


def metrics(state: WorldState, counts: TreeCounts, world: World) -> dict[str, Tensor]:
    """Return the metrics of each world's episode so far, float32 [B] each.

    ``saved``, ``burned``, ``extinguished``, ``cleared``, ``burning``: shares of the initial trees, saved being those
    that stand untouched or put out. ``burning_area``: area under the curve of burning trees, mean share over the
    horizon. ``control_time``: agent steps until no cell burned, or until now, as a share of the horizon.
    ``actions``: extinguish and clear actions, a share of the agents' steps. ``redundant``: the share of those on a
    target that a team-mate had. ``success``: 1 where the fire is out and at least 60 % is saved.

    Then those of the world's mechanics, see ``Mechanic.metrics``. Where there are several agencies,
    ``saved_agency_0`` and so on: what stands of the trees on the land of each, by their worth.

    Args:
        state: The worlds.
        counts: Of their trees.
        world: Their rules.
    """
    vehicles, horizon = state.vehicles, world.horizon
    acts = vehicles.acts.sum(1)
    agent_steps = (state.step * vehicles.acts.shape[1]).clamp(min=1)
    saved = counts.saved()
    found = {
        "saved": saved,
        "burned": counts.burned / counts.initial,
        "extinguished": counts.extinguished / counts.initial,
        "cleared": counts.cleared / counts.initial,
        "burning": counts.burning / counts.initial,
        "burning_area": state.burning_area / horizon,
        "control_time": state.step / horizon,
        "actions": acts / agent_steps,
        "redundant": vehicles.redundant.sum(1) / acts.clamp(min=1),
        "success": ((counts.alight == 0) & (saved >= SUCCESS_LEVEL)).to(torch.float32),
    }
    for each in world.loop:
        found |= each.metrics(state)
    return found
