"""How a team learns wind and rate of spread from the fire's edge, in numbers worked out by hand."""

import math

import pytest
import torch

from tests.world.drawing import CELLS, codes, draw
from tests.world.mechanics.belief.worlds import alight, begun, reset, rules, stay
from warp_torchrl.world.law.fire import Fire
from warp_torchrl.world.mechanics.belief import learning
from warp_torchrl.world.mechanics.belief.belief import Ensemble
from warp_torchrl.world.mechanics.belief.beliefs import beliefs_of
from warp_torchrl.world.state.records import recorded

UNKNOWN = {"rate_deviation": 0.3, "wind_speed_deviation": 0.5, "bearing_deviation": 45.0}
STANDS, BURNS = learning.STANDS, learning.BURNS
YES = torch.tensor([True])


def known(state, rates, seen, spreads, burned=0.0):
    """What a team knows of a world: particles of some rates, and what it saw of the cells."""
    begins = learning.begun(state, state.key, (0.3, 0.0, 0.0), (1, 2, 0, len(rates)))
    values = torch.zeros_like(begins.particles)
    values[..., 0] = torch.tensor(rates).log()
    return begins.replace(
        particles=values,
        outcome=torch.tensor(seen, dtype=torch.uint8)[None, None, None],
        spreads=torch.tensor(spreads)[None, None, None],
        burned=torch.full_like(begins.burned, burned),
    )


def weights(state, held, law, errors=(0.0, 0.0)):
    return learning.learned(state, held, law, errors, YES).weights.flatten().tolist()


def test_particles_are_weighed_by_what_became_of_the_trees_beside_the_fire():
    # In calm air a neighbour ignites a tree with alpha 0.4 and 0.2: 0.4 : 0.2 where it burns, 0.6 : 0.8 where it stands
    law, state = Fire(alpha=(0.0, 0.0, 0.4, 0.0, 0.0)), draw("TaT", fire=Fire(alpha=(0.0, 0.0, 0.4, 0.0, 0.0)))
    both = known(state, [1.0, 0.5], [BURNS, 0, STANDS], [0.0, 1.0, 0.0])
    assert weights(state, both, law) == pytest.approx([0.24 / 0.40, 0.16 / 0.40])
    unseen = known(state, [1.0, 0.5], [BURNS, 0, learning.UNSEEN], [0.0, 1.0, 0.0])
    assert weights(state, unseen, law) == pytest.approx([2 / 3, 1 / 3])
    # The neighbour burns in half the members: 0.2 : 0.1
    half = known(state, [1.0, 0.5], [0, 0, STANDS], [0.0, 0.5, 0.0])
    assert weights(state, half, law) == pytest.approx([0.8 / 1.7, 0.9 / 1.7])
    # The tree burned before with chance 0.5: 0.5 + 0.5 0.4 = 0.7 : 0.6. With miss 0.2, false alarm 0.1 0.59 : 0.52
    before = known(state, [1.0, 0.5], [BURNS, 0, 0], [0.0, 1.0, 0.0], burned=0.5)
    assert weights(state, before, law) == pytest.approx([0.7 / 1.3, 0.6 / 1.3])
    assert weights(state, before, law, (0.2, 0.1)) == pytest.approx([0.59 / 1.11, 0.52 / 1.11])


def test_where_few_particles_count_they_are_drawn_again_and_members_with_them():
    law = Fire(alpha=(0.0, 0.0, 0.4, 0.0, 0.0))
    state = draw("TaT", fire=law)
    rates = [1.0] * 8 + [0.1] * 56
    after = learning.learned(state, known(state, rates, [BURNS, 0, BURNS], [0.0, 1.0, 0.0]), law, (0.0, 0.0), YES)
    assert len(after.particles[..., 0].unique()) == 64, "they are moved"
    assert (after.particles[..., 0] * after.weights).sum() > -0.5 and (after.members[..., 0] > -1.5).all()


def test_trees_count_all_about_which_was_seen():
    drawing = "TTTTTT TaTTTT TTTTTT"
    state = draw(drawing)
    cells = codes(drawing, CELLS)[None, None]
    records = recorded(cells, torch.tensor([5]))
    records[..., 2, 3] = recorded(cells, torch.tensor([2]))[..., 2, 3]  # an older one
    planes = (cells == 11).float(), (cells == 11).float(), cells == 10
    since = recorded(torch.zeros(1, dtype=torch.int32), torch.tensor([4], dtype=torch.int32))
    begins = known(state, [1.0], [0] * 6, [0.0] * 6)
    edge = learning.watched(state, begins, planes, records, since).outcome[0, 0]
    assert edge.tolist() == [[1, 1, 1, 0, 0, 0], [1, 0, 0, 0, 0, 0], [1, 1, 0, 0, 0, 0]]


def test_what_became_of_a_tree_is_noted_when_it_is_seen_first():
    held = known(draw("TTTT"), [1.0], [1, 1, 1, 0], [0.0] * 4)
    cell, yes = torch.tensor([[[0, 1, 2, 3]]]), torch.ones(1, 1, 4, dtype=torch.bool)
    first, burns = yes & (cell != 2), cell != 1
    after = learning.noted(held, cell, first, burns)
    assert after.outcome.flatten().tolist() == [BURNS, STANDS, learning.UNSEEN, 0]
    assert learning.noted(after, cell, yes, ~burns).outcome.flatten().tolist() == [BURNS, STANDS, STANDS, 0]


def test_the_truth_lies_in_the_interval_before_anything_was_seen():
    # Particles lie about an estimate as the estimate does about the truth: in 90 % of worlds, less what 64 draws miss
    state = draw("TT", worlds=1000)
    begins = learning.begun(state, torch.arange(1000) * 7919, (0.3, 0.2, 15.0), (1, 4, 3, 64))
    low, high = (begins.particles.quantile(share, dim=2) for share in (0.05, 0.95))
    share = ((low <= 0) & (high >= 0)).float().mean(dim=(0, 1))
    assert (share - 0.89).abs().max() < 0.04  # 1000 draws: 4 standard deviations
    deviations = begins.particles.mean(dim=2).std(dim=0).flatten()
    assert deviations.tolist() == pytest.approx([0.2936, 0.1980, 0.2618], rel=0.1)
    assert begins.prior[0].tolist() == pytest.approx([0.2936, 0.1980, 0.2618], rel=1e-3)
    assert begins.hidden.std(dim=0).flatten().tolist() == pytest.approx([2**0.5 * 0.2936, 0.28, 0.37] * 3, rel=0.1)


def test_a_team_that_sees_all_learns_the_truth():
    world = rules(radius=12, steps_per_tick=1, belief=Ensemble(members=2, hidden=0, **UNKNOWN))
    state = begun(world, alight(world, reset(world, 24), (5, 3)))
    for _ in range(6):
        state = world.step(state, stay(state)).after
    found = world.belief.metrics(state)
    known = [found[f"{name}_known"].mean().item() for name in learning.PARAMETERS]
    assert min(known) > 0.7, "24 worlds: 0.9 less 3 standard errors"
    doubt = [found[f"{name}_doubt"].mean().item() for name in learning.PARAMETERS]
    assert doubt[0] < 0.7 and doubt[2] < 0.5


def test_hidden_fires_burn_at_rates_of_their_own():
    world = rules(steps_per_tick=1, belief=Ensemble(members=2, hidden=6, **UNKNOWN))
    state = reset(world)
    held = beliefs_of(state)
    slow = held.learning.hidden.clone()
    slow[:, :3, 0] = -20.0
    size = (held.hidden.held["cells"] > 10).flatten(2).sum(2)
    state = state.with_planes("belief", held.replace(learning=held.learning.replace(hidden=slow)))
    after = beliefs_of(world.step(state, stay(state)).after).hidden.held["cells"]
    grown = (after > 10).flatten(2).sum(2) - size
    assert (grown[:, :3] <= 0).all() and (grown[:, 3:] > 0).any()


def test_planners_and_baselines_do_not_read_the_true_wind():
    world = rules(belief=Ensemble(members=2, hidden=0, **UNKNOWN))
    state = reset(world)
    held = beliefs_of(state)
    values = torch.tensor([math.log(2.0), math.log(3.0), 0.0])
    own = held.learning.replace(
        particles=values.expand_as(held.learning.particles), members=values.expand_as(held.learning.members)
    )
    state = state.with_planes("belief", held.replace(learning=own))
    for worlds in (world.assumed(state), world.futures(state, 2)):
        assert worlds.wind[0].flatten().tolist() == pytest.approx((state.wind[0] * 3.0).flatten().tolist(), rel=1e-5)
        assert torch.allclose(worlds.alpha[0], (state.alpha[0] * 2.0).clamp(max=1.0))
