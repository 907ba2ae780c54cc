"""Worlds of teams with beliefs."""

import pytest
import torch

from tests.conftest import small_world
from tests.world.mechanics.there import is_there
from warp_torchrl.world.ensemble.members import lit
from warp_torchrl.world.law.fire import Fire
from warp_torchrl.world.law.hazard import HazardFire
from warp_torchrl.world.law.rate import RateFire
from warp_torchrl.world.mechanics.belief.belief import Ensemble
from warp_torchrl.world.state.state import Action
from warp_torchrl.world.team.team import Team
from warp_torchrl.world.terrain.landscape import Perlin

LAWS = {"paper": Fire(), "hazard": HazardFire(refinement=2), "rate": RateFire()}
BELIEVES = ("scenario=search", "belief=ensemble", "belief.members=3", "belief.hidden=6", "belief.rate_deviation=0.3")
WORLDS = {"believes": BELIEVES} if is_there("radio", "sensing") else {}


def rules(law="paper", radius=1, sight=None, belief=None, shares=True, size=12, **changes):
    """Rules of a forest of two agents that see little, with maps that they share, or not."""
    radio = pytest.importorskip("warp_torchrl.world.mechanics.radio.radio")
    sensing = pytest.importorskip("warp_torchrl.world.mechanics.sensing.sensing")
    own = {"belief": Ensemble(members=4, hidden=8) if belief is None else belief}
    return small_world(
        landscape=Perlin(size=size, relief=40.0, levels=(0.0, 0.0, 0.0)),
        fire=LAWS[law],
        sensing=sensing.Sight(**{"radius": radius, **(sight or {})}),
        mechanics=(radio.Radio(carries="map"),) if shares else (),
        **{"team": Team(n_agents=2), "steps_per_tick": 2, **own, **changes},
    )


def begun(world, state, *at, drop=False):
    """The worlds at the start of an episode, agents at places, without any fire if that is dropped."""
    if drop:
        state = without_fire(state)
    if at:
        position = torch.tensor(at).expand_as(state.vehicles.position).contiguous()
        state = state.replace(vehicles=state.vehicles.replace(position=position))
    for each in world.loop:
        state = each.begin(state, world)
    return state


def reset(world, worlds=1, seed=0):
    """The worlds after their reset."""
    return world.reset(torch.arange(seed, seed + worlds), torch.zeros(worlds, dtype=torch.int64))


def without_fire(state):
    """The worlds in which nothing burns."""
    burns = state.cells > 10
    return state.replace(
        cells=torch.where(burns, state.landscape.age, state.cells),
        age=torch.zeros_like(state.age),
        burned=torch.zeros_like(state.burned),
    )


def alight(world, state, *places):
    """The worlds in which trees were set alight."""
    where = torch.zeros_like(state.burned)
    for row, column in places:
        where[:, row, column] = True
    return lit(state, where, world.fire)


def stay(state):
    """Actions without effect."""
    return torch.full(state.vehicles.position.shape[:2], int(Action.STAY))
