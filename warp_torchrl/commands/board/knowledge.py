"""What the agents of a policy see and are told, in the words of the board."""

from collections.abc import Mapping
from typing import Literal

from warp_torchrl.heuristics import HEURISTICS
from warp_torchrl.runs.config.run_config import RunConfig
from warp_torchrl.world.team.knowledge import Belief
from warp_torchrl.world.world import World

Knowledge = Literal["none", "alone", "team", "advised", "all"]
"""What agents know; see ``MEANING``."""
MEANING: Mapping[str, str] = {
    "none": "it looks at nothing",
    "alone": "what each agent sees itself",
    "team": "also what the others tell: shared maps, messages, a belief",
    "advised": "also what a heuristic would do that knows what the team knows",
    "all": "every cell of the map",
}
_BLIND = ("noop", "random")


def knowledge_of(run_config: RunConfig, policy: str | None) -> Knowledge:
    """Return what the agents of a policy know in some worlds.

    Args:
        run_config: Of the evaluation.
        policy: Name of a baseline; None for a trained policy.
    """
    world, observation = run_config.world, run_config.observation
    if policy in _BLIND:
        return "none"
    if policy is not None:
        reads_map = HEURISTICS[policy].reads_map
        if not reads_map:
            return "team" if world.sensing.is_limited and _is_told(world) else "alone"
        return "team" if world.sensing.is_limited else "all"  # on the map that the team assumes
    is_advised = getattr(observation, "advice", None) is not None
    if not world.sensing.is_limited:
        return "all" if is_advised or "picture" in observation.spaces(world) else "alone"
    if is_advised:
        return "advised"
    return "team" if _is_told(world) or getattr(run_config.model, "messages", "none") != "none" else "alone"


def _is_told(world: World) -> bool:
    """Return whether agents know what others saw, or what the team believes."""
    return bool(getattr(world.hearing, "sends_maps", False)) or type(world.belief) is not Belief
