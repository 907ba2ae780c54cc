"""Worlds drawn by hand in which mechanics begin and step, and what agents know of them."""

import torch

from tests.world.drawing import CELLS, codes, draw
from warp_torchrl.world.state.records import freshness, kept, known_codes


def begun(world, *at, drawing, worlds=1, **options):
    """Drawn worlds of some rules at the start of an episode, agents at places."""
    state = draw(drawing, team=world.team, at=list(at), worlds=worlds, **options)
    for each in world.loop:
        state = each.begin(state, world)
    return state


def later(state, world, *at, drawing=None, running=True):
    """The worlds a step later: agents at other places, and perhaps other cells, in those that go on."""
    cells = state.cells if drawing is None else codes(drawing, CELLS).expand_as(state.cells)
    position = torch.tensor(at).expand_as(state.vehicles.position) if at else state.vehicles.position
    after = state.replace(cells=cells, step=state.step + 1, vehicles=state.vehicles.replace(position=position))
    for each in world.loop:
        after = each.step(state, after, torch.as_tensor(running).expand_as(state.done), world)
    return after


def known(state, agent, world=0):
    """The map of an agent as a drawing, a question mark where it has never been."""
    fresh = freshness(kept(state), state.step)[world, agent]
    cells = known_codes(state)[world, agent]
    return ["".join(CELLS[c] if f > 0 else "?" for c, f in zip(*row)) for row in zip(cells.tolist(), fresh.tolist())]
