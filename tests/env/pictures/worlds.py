"""Worlds whose pictures tests look at."""

import torch

from warp_torchrl.world.backends.tick import initial_state
from warp_torchrl.world.ignition.ignition import Ignition
from warp_torchrl.world.state.state import Cover, Landscape, WorldState
from warp_torchrl.world.team.team import Team
from warp_torchrl.world.terrain.landscape import Perlin
from warp_torchrl.world.world import World


def small_world(size=(8, 8), n_agents=2, roles=("ugv", "uav"), worlds=1) -> tuple[Team, WorldState]:
    team = Team(n_agents=n_agents, roles=roles)
    world = World(landscape=Perlin(size=size), team=team, ignition=Ignition(count=1))
    seeds = torch.arange(worlds)
    return team, world.reset(seeds, torch.zeros_like(seeds))


def drawn(cells: list[list[int]], cover: Cover | list[list[int]] = Cover.FOREST, at=((0, 0),), **planes) -> WorldState:
    """Return one world from hand-written codes, with an agent at each place of ``at``."""
    codes = torch.tensor([cells], dtype=torch.uint8)
    ground = torch.full_like(codes, cover) if isinstance(cover, int) else torch.tensor([cover], dtype=torch.uint8)
    world, key = World(), torch.zeros(1, dtype=torch.int64)
    team = Team(n_agents=len(at)).place(key, ground, codes)
    landscape = Landscape(cover=ground, age=codes, elevation=None)
    state = initial_state(
        landscape, world.fire, torch.zeros(1, 2, 1, 1), key, team.replace(position=torch.tensor([at])), 30.0
    )
    return state.replace(**{name: torch.tensor([plane]).to(getattr(state, name)) for name, plane in planes.items()})
