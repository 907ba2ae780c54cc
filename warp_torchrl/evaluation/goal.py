"""The metric by which policies of a team are compared."""

from collections.abc import Mapping, Sequence

from warp_torchrl.env.metrics import chosen_goal, metric_rows
from warp_torchrl.evaluation.units import sign_of
from warp_torchrl.world.mechanics.mechanic import Metric
from warp_torchrl.world.state.role import ROLES
from warp_torchrl.world.team.abilities import ABILITIES
from warp_torchrl.world.world import World

SAVED = Metric("saved", "more")
"""The trees saved, what most worlds are compared by."""


def goal(world: World) -> Metric:
    """Return the metric of a comparison: the world's own goal, else the trees saved.

    Where no member of the team can act, and the front that it watches is counted, it is that.

    Raises:
        ValueError: If the world's goal is none of its metrics.
    """
    chosen = chosen_goal(world)
    if chosen is not None:
        return chosen
    acts = any(not ABILITIES[name].moves for role in world.team.agent_roles for name in ROLES[role].abilities)
    watched = [row for row in metric_rows(world) if row.name == "watched" and not acts]
    return watched[0]._replace(better="more") if watched else SAVED


def better_of(reached: Mapping[str, Sequence[float]], goals: Sequence[Metric]) -> str:
    """Return the name of what reaches more of its goals: the sum over kinds of worlds, each with one goal.

    Numbers that are no shares count as parts of the largest of their kind, so that minutes add up with shares.

    Args:
        reached: By name, the mean of each kind's goal.
        goals: Of the kinds.
    """
    largest = [max((abs(each[kind]) for each in reached.values()), default=0.0) for kind in range(len(goals))]
    scale = [1.0 if goal.unit == "%" else top or 1.0 for goal, top in zip(goals, largest, strict=True)]

    def total(name: str) -> float:
        return sum(sign_of(goal) * value / by for value, goal, by in zip(reached[name], goals, scale, strict=True))

    return max(reached, key=total)
