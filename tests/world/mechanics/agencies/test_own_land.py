"""The baseline whose vehicles look after the land that they serve."""

import torch

from tests.conftest import small_world
from warp_torchrl.env import WildfireEnv
from warp_torchrl.heuristics import HEURISTICS
from warp_torchrl.world.mechanics.agencies.agencies import SeveralAgencies
from warp_torchrl.world.state.state import Action
from warp_torchrl.world.team.team import Team
from warp_torchrl.world.terrain.landscape import Perlin


def played(**options):
    world = small_world(landscape=Perlin(size=16, levels=(0.0, 0.0, 0.0)), team=Team(n_agents=4), **options)
    env = WildfireEnv(world, n_worlds=8, seed=1)
    return env, env.reset()


def test_who_serves_a_land_without_fire_waits_and_the_others_go():
    env, now = played(agencies=SeveralAgencies())
    state = env.world_state
    of_first = state.plane("agencies", "owner") == 0
    # A fire in each world, on the first land alone, away from all vehicles.
    burning = torch.zeros_like(of_first)
    cells = torch.where(of_first, 100.0, 0.0)
    far = torch.full_like(cells, 99.0)
    for agent in range(4):
        rows, columns = (torch.arange(16) - state.vehicles.position[:, agent, axis, None] for axis in (0, 1))
        far = torch.minimum(far, torch.maximum(rows.abs()[:, :, None], columns.abs()[:, None]).float())
    burning.flatten(1).scatter_(1, (cells + far).flatten(1).argmax(1, keepdim=True), True)
    codes = torch.where(burning, 11, torch.where(state.cells > 10, 10, state.cells)).to(torch.uint8)
    now = env.set_state(state.replace(cells=codes))
    action = HEURISTICS["own_land"](env)(now)["agents", "action"]
    assert (action[:, 2:] == int(Action.STAY)).all() and (action[:, :2] < 8).all()
    both = HEURISTICS["coordinated"](env)(now)["agents", "action"]
    assert (both[:, 2:] < 8).all(), "who looks after all land goes"


def test_with_one_agency_it_is_coordinated():
    env, now = played()
    for _ in range(4):
        own, all_land = (HEURISTICS[name](env)(now.clone())["agents", "action"] for name in ("own_land", "coordinated"))
        assert torch.equal(own, all_land)
        now = env.step_mdp(env.step(now.set(("agents", "action"), own)))
