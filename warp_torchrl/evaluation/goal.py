"""The metric by which policies of a team are compared."""

from typing import Literal

from warp_torchrl.world.state.role import ROLES
from warp_torchrl.world.team.abilities import ABILITIES
from warp_torchrl.world.world import World

Goal = Literal["saved", "watched"]
"""A metric."""


def goal(world: World) -> Goal:
    """Return the metric of a comparison: the trees saved, or the front watched where no member of the team can act."""
    acts = any(not ABILITIES[name].moves for role in world.team.agent_roles for name in ROLES[role].abilities)
    return "watched" if "watched" in world.metric_names and not acts else "saved"
