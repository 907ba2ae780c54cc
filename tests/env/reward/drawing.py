"""Forests drawn as text, and what a step in them earns."""

import torch

from tests.conftest import small_world
from warp_torchrl.world.law.fire import Fire
from warp_torchrl.world.state.state import Action
from warp_torchrl.world.team.team import Team
from warp_torchrl.world.terrain.array import Array

STAY, CLEAR, EXTINGUISH, EAST = int(Action.STAY), int(Action.CLEAR), int(Action.EXTINGUISH), int(Action.EAST)


def drawn(rows, positions, *, steps_per_tick=1000, fire=None):
    """A forest world drawn as text: T a tree of age 5, F a fire in its first stage, ~ a lake."""
    codes = torch.tensor([[{"T": 5, "F": 11, "~": 0}[each] for each in row] for row in rows], dtype=torch.uint8)[None]
    cover = torch.tensor([[0 if each == "~" else 3 for each in row] for row in rows])
    land = Array(cover=cover, age=torch.full(cover.shape, 5))
    world = small_world(
        landscape=land,
        team=Team(n_agents=len(positions), start="anywhere"),
        steps_per_tick=steps_per_tick,
        fire=fire or Fire(),
    )
    state = world.reset(torch.tensor([0]), torch.tensor([0]))
    state = state.replace(
        cells=codes,
        age=torch.where(codes == 11, 5, 0).to(torch.uint8),
        burned=torch.zeros_like(state.burned),
        vehicles=state.vehicles.replace(position=torch.tensor(positions)[None]),
    )
    return state, world


def earned(reward, state, world, *actions):
    return reward(world.step(state, torch.tensor([actions])))[0, :, 0].tolist()


FIELD = ["TTTT", "TFTT", "TTTT", "TTTT"]  # 16 trees, one of them burning
