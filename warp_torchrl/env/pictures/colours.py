"""Colours of cells, agents and text in pictures."""

import torch
from torch import Tensor

from warp_torchrl.system.modes import kept
from warp_torchrl.world.state.state import OLDEST, Cover

# The fire front, 11..13, is lighter than any ground; 14 stays 16 units of CIE Lab off without the red or green cone.
GROUND = {  # without a tree, youngest tree, oldest tree
    Cover.LAKE: ((34, 76, 142),) * 3,
    Cover.WETLAND: ((118, 140, 144), (92, 134, 138), (52, 98, 108)),
    Cover.GRASSLAND: ((152, 146, 124), (140, 154, 100), (96, 124, 72)),
    Cover.FOREST: ((132, 124, 110), (88, 126, 92), (36, 82, 62)),
    Cover.BARE: ((140, 136, 144),) * 3,
}
FIRE = ((255, 246, 120), (255, 198, 44), (255, 138, 34), (226, 42, 26), (136, 16, 48))
ASH, FIREBREAK, WATER = (40, 38, 42), (230, 204, 168), (84, 196, 255)
AGENT = (((255, 255, 255), (124, 30, 190)), ((16, 18, 24), (90, 236, 255)))  # each role's outline and body
AGES, FIRE_ROW, ASH_ROW, FIREBREAK_ROW, WET_ROW, FOG_ROW = 11, 55, 60, 61, 62, 124
"""Rows of ``colour_table``: of each cover, and where the other kinds begin."""
HOUSE, LOST = (240, 241, 243), FIRE[4]
"""Of buildings that have all of their worth, and none."""
PAPER, INK, SOFT, LINE = (24, 27, 32), (240, 241, 243), (168, 170, 174), (98, 101, 105)
"""Colours of the panel: ground, text, its captions, lines."""


def fire_colours() -> Tensor:
    """Return the colours of the burning stages, the first one first, uint8 [5, 3]."""
    return torch.tensor(FIRE, dtype=torch.uint8)


def legend_colours(has_buildings: bool = False) -> dict[str, tuple[int, int, int]]:
    """Return a colour of each item that is drawn on a map, by its name."""
    covers = {cover.name.lower(): GROUND[cover][-1] for cover in Cover}
    drawn = {**covers, "fire": FIRE[2], "ember": FIRE[4], "ash": ASH, "firebreak": FIREBREAK, "wet": WATER}
    return {**drawn, "house": HOUSE, "house, lost": LOST} if has_buildings else drawn


@kept(8)
def colour_table(device: torch.device) -> Tensor:
    """Return the colours of dry, of wet, and of cells in fog: trees by cover and age, fire, ash, firebreak.

    uint8 [186, 3].
    """
    empty, young, old = torch.tensor([GROUND[cover] for cover in Cover], dtype=torch.float32).unbind(1)
    ages = young[:, None] + (old - young)[:, None] * torch.linspace(0.0, 1.0, OLDEST)[:, None]
    ground = torch.cat((empty[:, None], ages), dim=1).flatten(0, 1)
    dry = torch.cat((ground, torch.tensor([*FIRE, ASH, FIREBREAK])))
    wet = dry.lerp(torch.tensor(WATER, dtype=torch.float32), 0.65)
    wet[FIRE_ROW:ASH_ROW] = dry[FIRE_ROW:ASH_ROW]
    fog = dry.lerp(torch.tensor(PAPER, dtype=torch.float32), 0.6)
    return torch.cat((dry, wet, fog)).round().to(torch.uint8).to(device)
