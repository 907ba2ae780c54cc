"""What a team believes as colours, on a map that is drawn by hand."""

from types import SimpleNamespace

import pytest
import torch

from tests.world.drawing import draw, knowing
from warp_torchrl.env.pictures.render import ground_colours
from warp_torchrl.env.pictures.veil import BELIEVED, FOG, HIDDEN, can_believe, checked_view, first_view, seen_as
from warp_torchrl.world.state.records import recorded
from warp_torchrl.world.team.knowledge import Full
from warp_torchrl.world.world import World

TRUTH, TAKEN = "aTTTT TTTTb", "TTTTT TTTTb"
LIKELY, SURE = (0, 2), (1, 4)
BARE = (0, 1)


def scene():
    """A fire at two places of which the team knows one, and rules by which another cell is likely to burn."""
    state = draw(TRUTH)
    kinds = draw(TAKEN).cells[:, None]
    records = recorded(kinds, state.step + 1)
    state = knowing(state.replace(step=state.step + 1), records)
    known, hidden = torch.zeros(2, 1, 1, 2, 5)
    known[0, 0, 0, 2], known[0, 0, 1, 4], hidden[0, 0, 1, 0] = 0.5, 1.0, 0.3
    sensing = SimpleNamespace(is_limited=True)
    return state, SimpleNamespace(
        sensing=sensing,
        assumed=lambda given: given.replace(cells=kinds[:, 0]),
        believed_fire=lambda given: (known, hidden),
    )


def far(colour, other):
    return (colour.float() - torch.tensor(other).float()).norm()


def test_the_truth_is_the_picture_of_every_world():
    state, world = scene()
    shown, colours = seen_as(state, world, "truth")
    assert shown is state and torch.equal(colours, ground_colours(state))
    all_seen = SimpleNamespace(sensing=Full())
    assert not can_believe(all_seen) and torch.equal(seen_as(state, all_seen, "belief")[1], colours)


def test_a_belief_shows_what_is_thought_to_burn_and_nothing_of_the_fire():
    state, world = scene()
    shown, colours = seen_as(state, world, "belief")
    assert (shown.cells > 10).sum() == 1 and torch.equal(shown.vehicles.position, state.vehicles.position)
    assert torch.equal(colours[0, 0, 0], colours[0, *BARE]), "the fire that it does not know"
    assert far(colours[0, *SURE], BELIEVED[-1]) < 25.0
    assert far(colours[0, *LIKELY], BELIEVED[1]) < far(colours[0, *BARE], BELIEVED[1])


def test_a_hidden_fire_is_faint_and_what_is_not_seen_for_long_is_in_fog():
    state, world = scene()
    colours = seen_as(state, world, "belief")[1][0]
    assert 30.0 < far(colours[1, 0], HIDDEN) < far(colours[1, 1], HIDDEN)
    later = seen_as(state.replace(step=state.step + 300), world, "belief")[1][0]
    assert far(later[BARE], FOG) < 25.0 < 60.0 < far(colours[BARE], FOG)


def test_both_lays_the_veil_over_the_fire_which_stays_what_it_is():
    state, world = scene()
    shown, colours = seen_as(state, world, "both")
    plain = ground_colours(state)
    assert shown is state and torch.equal(colours[0, 0, 0], plain[0, 0, 0]), "it burns, and nobody thinks so"
    over_fire, over_tree = (far(colours[0, *at], plain[0, *at].tolist()) for at in (SURE, LIKELY))
    assert 0.0 < over_fire < over_tree


def test_cells_of_agents_that_know_their_own_maps_are_those_of_the_last_to_look():
    state, world = scene()
    kinds = torch.stack((draw("TTTTT TTTTb").cells, draw("aTTTT TTTTT").cells), dim=1)
    steps = torch.tensor([[3, 1, 1, 1, 1], [1, 1, 1, 1, 1]])
    records = torch.stack((torch.full_like(steps, 2), steps))[None] * 64
    world.assumed = lambda given: given[torch.tensor([0, 0])].replace(cells=kinds[0])
    shown = seen_as(knowing(state, records.to(torch.int32)), world, "belief")[0]
    assert shown.cells[0, 0, 0] == 11 and shown.cells[0, 1, 4] == 12, "the second saw the first cell last"


def test_a_view_that_is_none_is_refused_and_worlds_without_beliefs_begin_with_the_truth():
    assert checked_view("both") == "both" and first_view(World()) == "truth"
    with pytest.raises(ValueError, match=r"^view must be one of truth, belief, both, got all$"):
        checked_view("all")
