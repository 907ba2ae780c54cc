"""The rules of the world, as agents are told them: what one policy needs to know to play in worlds of several."""

import math

import torch
from torch import Tensor

from warp_torchrl.entries import LARGEST_TEAM, TEAM_SIZE, Part
from warp_torchrl.world.state.state import FIRST_FIRE
from warp_torchrl.world.world import World

RULES = Part(
    "scalar",
    ("rule_ticks", "rule_burning", "rule_wet", "rule_horizon", "rule_tank", "rule_stride", TEAM_SIZE, "rule_map"),
)
"""Entries of ``status`` that tell the rules, see ``rules_of``."""


def rules_of(world: World, device: torch.device) -> Tensor:
    """Return what each agent is told of the rules, float32 [A, 8], numbers in 0..1 in all scenarios.

    They are the ticks of the fire a step, 1 / ``steps_per_tick``; the steps for which a cell spreads fire and those for
    which a tree that was put out stays wet, as log2(1 + steps) / 16; the horizon, log2(steps) / 16; how soon a tank
    runs dry, 1 / (1 + capacity), 0 without a limit; the cells of a move, stride / 4; the size of the team, log2(A) / 8;
    and the longer side of the map, log2(cells) / 16. How strong the fire is, the channel ``threat`` tells.
    """
    team, fire, ticks = world.team, world.fire, world.steps_per_tick
    burning = (fire.last_spreading - FIRST_FIRE + 1) * fire.ticks_per_stage * ticks
    told = {
        "rule_ticks": 1.0 / ticks,
        "rule_burning": math.log2(1 + burning) / 16,
        "rule_wet": math.log2(1 + fire.wet_for * ticks) / 16,
        "rule_horizon": math.log2(world.horizon) / 16,
        "rule_tank": 0.0 if team.tank is None else 1.0 / (1 + team.tank),
        TEAM_SIZE: math.log2(team.n_agents) / LARGEST_TEAM,
        "rule_map": math.log2(max(world.size)) / 16,
    }
    stride = team.table(device).stride * 0.25
    return torch.stack(
        [stride if name == "rule_stride" else torch.full_like(stride, told[name]) for name in RULES.names], dim=-1
    )
