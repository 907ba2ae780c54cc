"""Beliefs of worlds drawn by hand: members, hidden fires and sightings as drawings."""

import torch

from tests.world.drawing import CELLS, codes, draw
from warp_torchrl.world.arrays.batch import Named
from warp_torchrl.world.mechanics.belief.beliefs import NAME, Beliefs, beliefs_of
from warp_torchrl.world.mechanics.belief.sightings import Sightings


def planes(*drawings):
    """Cells of drawings, uint8 [1, n, H, W]."""
    return torch.stack([codes(each, CELLS) for each in drawings])[None]


def believing(drawing, *members, weights=None, hidden=(), possible=None, chances=None, **options):
    """A world as drawn, whose team believes in members that are drawn too.

    Args:
        drawing: The world.
        members: Each a drawing.
        weights: Of the members; alike unless given.
        hidden: Hidden fires, each a drawing.
        possible: How likely each is.
        chances: Of the cells to have ignited in the last tick, a number for each member.
        options: See ``draw``.
    """
    state = draw(drawing, **options)
    cells = planes(*members)
    no, none = torch.zeros_like(cells, dtype=torch.bool), torch.zeros_like(cells)
    own = {"cells": cells, "age": none + 10 * (cells > 10), "burned": no, "firebreak": no.clone(), "wet": none.clone()}
    if state.stage_age is not None:
        own["stage_age"] = none.clone()
    lit = planes(*hidden) if hidden else None
    m, count = len(hidden), len(members)
    beliefs = Beliefs(
        members=Named({**own, "extinguished": no.clone(), "key": torch.arange(count)[None]}),
        weights=torch.tensor([[weights or [1.0 / count] * count]]),
        learning=None,
        chances=Named({"values": torch.tensor([chances or [0.0] * count])[..., None, None] * (cells > 0)}),
        hidden=Named() if lit is None else Named({"cells": lit, "age": none[:, :1].expand_as(lit), "burned": lit == 0}),
        possible=torch.tensor([[possible or [1.0] * m]]),
        found=torch.zeros(1, 1, m),
        lit=no[:, :1].clone(),
        fires=torch.zeros(1, 1, dtype=torch.int32),
        unseen=torch.zeros(1, 1, *cells.shape[2:]),
        soon=torch.zeros(1, 1, *cells.shape[2:]),
        overlap=torch.zeros_like(state.step),
        union=torch.zeros_like(state.step),
        skill=torch.zeros_like(state.burning_area),
        skills=torch.zeros_like(state.burning_area),
        alight=torch.zeros_like(state.step),
    )
    return state.with_planes(NAME, beliefs)


def seen(*cells, first=True):
    """The sightings of cells, each (flat index, character)."""
    index, code = torch.tensor([[[at for at, _ in cells]]]), [[[CELLS.find(each) for _, each in cells]]]
    yes, no = torch.ones_like(index, dtype=torch.bool), torch.zeros_like(index, dtype=torch.bool)
    return Sightings(index, yes, yes & first, torch.tensor(code, dtype=torch.uint8), no, no)


def members(state, belief=0):
    """The members of a belief as drawings."""
    held = beliefs_of(state)
    count = held.weights.shape[2]
    cells = held.members.held["cells"][0, belief * count : (belief + 1) * count]
    return [" ".join("".join(CELLS[code] for code in row) for row in each.tolist()) for each in cells]
