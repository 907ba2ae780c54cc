"""How likely trees ignite beside sources that are only likely, at other rates and in other winds."""

import pytest
import torch

from tests.world.drawing import draw
from warp_torchrl.world.arrays.geometry import DIRECTIONS
from warp_torchrl.world.ensemble.members import in_other_air, in_parameters
from warp_torchrl.world.law.arrivals import metric
from warp_torchrl.world.law.automaton import Beside
from warp_torchrl.world.law.fire import Fire
from warp_torchrl.world.law.hazard import HazardFire
from warp_torchrl.world.law.lattice import LatticeFire
from warp_torchrl.world.law.rate import RateFire
from warp_torchrl.world.law.travel import rate_from
from warp_torchrl.world.state.state import Air

DRAWING = "TTaTT TbTTT TTTGT TaT#T"
VALUES = torch.tensor([[0.0, 0.0, 0.0], [0.5, 0.4, 1.0], [-0.7, -0.3, -2.0]])


def beside(state, cells, burns):
    """Some cells of one world, and where sources are."""
    height, width = state.cells.shape[1:]
    sources = torch.zeros(1, 8, len(cells))
    for at, cell in enumerate(cells):
        for d, (down, right) in enumerate(DIRECTIONS):
            row, column = cell // width - down, cell % width - right
            if 0 <= row < height and 0 <= column < width:
                sources[0, d, at] = burns[0, row, column]
    return Beside(torch.tensor([cells]), sources)


def chances(state, law, burns):
    trees = (state.cells[0].flatten() <= 10).nonzero()[:, 0].tolist()
    air = Air(in_other_air(state.wind.expand(3, -1, -1, -1), VALUES))
    return trees, law.ignition_beside(state, beside(state, trees, burns), VALUES[None, :, 0].exp(), air)[0]


@pytest.mark.parametrize("law", [Fire(), Fire(neighbours=4), HazardFire(), LatticeFire()], ids=str)
def test_beside_sure_sources_it_is_what_the_law_says(law):
    state = draw(DRAWING, wind=(3.0, 1.0), fire=law, elevation=(torch.arange(20.0).view(4, 5) * 7.0).tolist())
    trees, found = chances(state, law, law.spreads(state).float())
    for each, own in zip(VALUES, found, strict=True):
        expected = law.ignition_probability(in_parameters(state, law, each[None])).flatten()[trees]
        assert torch.allclose(own * law.can_ignite(state).flatten()[trees], expected, atol=1e-6)


def test_a_source_that_is_likely_counts_for_its_chance():
    # Two sources, each with chance 1/2, ignite a tree with 0.4 each: 1 - 0.8^2
    law = Fire(alpha=(0.0, 0.0, 0.4, 0.0, 0.0), diagonal="unit")
    state = draw("aTb", fire=law)
    held = Beside(torch.tensor([[1]]), torch.zeros(1, 8, 1))
    held.spreads[0, 2], held.spreads[0, 6] = 0.5, 0.5
    chance = law.ignition_beside(state, held, torch.ones(1, 1), Air(state.wind))
    assert chance.item() == pytest.approx(1 - 0.8**2)


def test_under_law_rate_it_is_the_share_of_a_cell_that_fire_goes():
    law = RateFire(minutes_per_tick=0.5, cell_deviation=0.0)
    state = draw("TTT TaT TTT", wind=(3.0, 1.0), fire=law)
    trees, found = chances(state, law, law.spreads(state).float())
    around = {0: 7, 1: 0, 2: 1, 3: 6, 5: 2, 6: 5, 7: 4, 8: 3}  # the direction of travel into each cell
    for each, own in zip(VALUES, found, strict=True):
        other = in_parameters(state, law, each[None])
        rates = metric(other.ground, other.air)
        expected = [rate_from((around[cell] + 4) % 8, rates).flatten()[cell].item() * 0.5 for cell in trees]
        assert own.tolist() == pytest.approx([min(1.0, chance) for chance in expected], rel=1e-4)
