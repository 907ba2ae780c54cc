"""Small fires of known parameters, and drawings of cells."""

import math
from dataclasses import replace

import torch

from warp_torchrl.prediction.calibration.candidates import median_arrivals
from warp_torchrl.prediction.calibration.case import FireCase
from warp_torchrl.world.fires.spell import Spell
from warp_torchrl.world.law.rate import RateFire
from warp_torchrl.world.state.state import Landscape

MOISTURE = {"ffmc": 86.0}


def drawn(*rows):
    """Return where a drawing has a hash, bool [H, W]."""
    return torch.tensor([[cell == "#" for cell in row] for row in rows])


def fire(**values):
    return RateFire(model="fbp", moisture=MOISTURE, **values)


def case_of(truth, wind=(4.0, 1.0), side=41, name="drawn", turned=60.0):
    """Return a fire of a law, in a forest C-2 beside grass O-1a on a slope; the wind turns after two hours."""
    fuel = torch.full((1, side, side), 2, dtype=torch.int16)
    fuel[:, :, side // 2 + 3 :] = 31
    rows = torch.arange(float(side))
    cover = torch.full((1, side, side), 3, dtype=torch.uint8)
    land = Landscape(
        cover=cover,
        age=torch.full_like(cover, 10),
        elevation=(12.0 * rows[:, None] + 4.0 * rows)[None],
    ).with_layers(fuel=fuel)
    unknown = torch.full((7,), math.nan)
    spells = [Spell(torch.tensor(wind), 180.0 - turned, unknown)]
    spells += [Spell(torch.tensor((wind[1], -wind[0])), turned, unknown)] if turned else []
    lit = torch.zeros(side, side, dtype=torch.bool)
    lit[side // 2, side // 4] = True
    case = FireCase(
        name=name,
        landscape=land,
        cell_size=50.0,
        lit=lit,
        spells=spells,
        minutes=torch.tensor([60.0, 120.0, 180.0]),
        burned=torch.ones(3, side, side, dtype=torch.bool),
    )
    times = median_arrivals([truth], case)[0, 0]
    return replace(case, burned=times <= case.minutes[:, None, None])


def cases_of(truth):
    return [case_of(truth, name="east"), case_of(truth, (0.5, 2.0), name="north")]
