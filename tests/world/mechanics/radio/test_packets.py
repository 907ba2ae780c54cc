"""Packets that are under way, by hand."""

import pytest
import torch

from tests.conftest import small_world
from tests.world.drawing import tiled
from tests.world.mechanics import drawing
from warp_torchrl.world.arrays.batch import concatenated
from warp_torchrl.world.mechanics.radio.packets import Named, Packets, moved_up
from warp_torchrl.world.mechanics.radio.radio import Radio
from warp_torchrl.world.team.team import Team

MAP = tiled("...... ......", 2, 2)


def rules(n_agents, **radio):
    return small_world(team=Team(n_agents=n_agents), mechanics=(Radio(**radio),))


def begun(world, *at, worlds=1):
    return drawing.begun(world, *at, drawing=MAP, worlds=worlds)


def flies(world):
    return world.team.table(torch.device("cpu")).flies


def arriving(state, world):
    return {(i, j) for i, j in world.hearing.arriving(state, flies(world))[0].nonzero().tolist()}


def test_steps_move_up_where_worlds_go_on():
    steps = torch.tensor([[1, 2, 3], [4, 5, 6]])
    assert moved_up(steps, torch.tensor([7, 8]), torch.tensor([True, False])).tolist() == [[2, 3, 7], [4, 5, 6]]


def test_tensors_of_any_names_are_a_batch():
    packets = Packets(
        torch.zeros(2, 1, 3, 3), torch.zeros(2, 1, 3, 2), shown=Named({"": torch.arange(2), "status": torch.arange(2)})
    )
    assert [*packets.leaves()] == ["links", "places", "shown.", "shown.status"]
    both = concatenated([packets, packets])[torch.tensor([1, 2])]
    assert both.shown.held["status"].tolist() == [1, 0] and both.links.shape == (2, 1, 3, 3)


def test_a_packet_reaches_those_that_heard_its_sender_when_it_was_sent():
    world = rules(2, range=3.0, delay=2)
    state = begun(world, (0, 0), (0, 3))  # sent in step 0, in range
    assert arriving(state, world) == set()
    state = drawing.later(state, world, (1, 0), (0, 9))  # sent in step 1, out of range
    assert arriving(state, world) == set()
    state = drawing.later(state, world, (2, 1), (2, 3))
    assert arriving(state, world) == {(0, 1), (1, 0)}, "of step 0"
    shown = world.hearing.observed(state, flies(world))[0]
    assert shown[0, 1].tolist() == [1.0, -2.0, 2.0], "from (2, 1) to (0, 3), where the sender was"
    assert shown[1, 0].tolist() == [1.0, -2.0, -3.0]
    state = drawing.later(state, world, (2, 2), (2, 3))
    assert arriving(state, world) == set(), "of step 1, though they are side by side now"
    assert not world.hearing.observed(state, flies(world)).any()
    assert arriving(drawing.later(state, world, (0, 0), (0, 11)), world) == {(0, 1), (1, 0)}, "of step 2"


@pytest.mark.parametrize("delay", [0, 1, 3])
def test_what_is_lost_is_drawn_when_it_is_sent(delay):
    world = rules(3, loss=0.4, range=6.0, delay=delay)
    state, sent, places = begun(world, (0, 0), (0, 4), (0, 9), worlds=30), [], []
    for step in range(8):
        sent.append(world.hearing.heard(state, flies(world)))
        places.append(state.vehicles.position)
        found = world.hearing.arriving(state, flies(world))
        assert torch.equal(found, sent[step - delay]) if step >= delay else not found.any()
        assert step < delay or torch.equal(world.hearing.places(state), places[step - delay])
        state = drawing.later(state, world, (0, 0), (0, step), (1, 9))
    assert sent[0].any() and not torch.equal(sent[0], sent[1])


def test_without_delay_nothing_is_under_way():
    world = rules(2, carries="graph", range=4.0)
    state = world.reset(torch.arange(2), torch.zeros(2, dtype=torch.int64))
    assert not state.keeps("radio") and not any("radio" in name for name in state.what_changes())
    assert world.hearing.step(state, state, ~state.done, world) is state
    assert torch.equal(world.hearing.places(state), state.vehicles.position)


def test_worlds_of_another_delay_are_refused():
    world = rules(2, delay=2)
    state = begun(world, (0, 0), (0, 3))
    for other, got in (
        (state.without_planes("radio"), 0),
        (begun(rules(2, delay=1), (0, 0), (0, 3)), 2),
    ):
        with pytest.raises(
            ValueError, match=f"must have the packets of 3 steps where mechanics.radio.delay is 2, got {got}"
        ):
            world.hearing.arriving(other, flies(world))
    talking = Radio(delay=2, carries="graph")
    with pytest.raises(ValueError, match="must tell what their agents sent"):
        talking.shown(state)
