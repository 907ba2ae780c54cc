"""Small worlds drawn by hand, for heuristics to act in."""

import torch

from tests.world.drawing import draw, drawn_cover
from warp_torchrl.env import WildfireEnv
from warp_torchrl.heuristics import HEURISTICS
from warp_torchrl.world.air.wind import Calm
from warp_torchrl.world.law.fire import Fire
from warp_torchrl.world.state.state import Action, WorldState
from warp_torchrl.world.team.team import Team
from warp_torchrl.world.terrain.array import Array
from warp_torchrl.world.world import World


def scene(drawing: str, *, at: list[tuple[int, int]], base: tuple[int, int] = (0, 0), growth: bool = False, **team):
    """An environment of one world, and the world as drawn, in calm air, with a team of so many bulldozers as places.

    Args:
        drawing: See ``tests.world.drawing``.
        at: (row, column) of each agent.
        base: (row, column) of the corner where they started.
        growth: Whether trees grow.
        team: Further fields of ``Team``.
    """
    cover = drawn_cover(drawing).numpy()
    vehicles = Team(n_agents=len(at), **team)
    world = World(
        landscape=Array(cover=cover, age=cover * 0 + 10), wind=Calm(), fire=Fire(growth=growth), team=vehicles
    )
    env = WildfireEnv(world, n_worlds=1, seed=0)
    state = draw(drawing, team=vehicles, at=at, fire=world.fire)
    return env, state.replace(vehicles=state.vehicles.replace(base=torch.tensor([base])))


def with_tanks(state: WorldState, *tanks: int) -> WorldState:
    """The worlds with so much water in the agents' tanks."""
    return state.replace(
        vehicles=state.vehicles.replace(tank=torch.tensor([tanks] * len(state.cells), dtype=torch.int32))
    )


def chosen(env: WildfireEnv, state: WorldState, name: str = "dispatch") -> list[str]:
    """The names of what a heuristic does."""
    actions = HEURISTICS[name](env).choose(state, env.world.possible_actions(state))[0].tolist()
    return [Action(each).name for each in actions]
