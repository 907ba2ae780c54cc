"""Packets that are under way, by hand."""

import pytest
import torch

from tests.conftest import small_world
from tests.world.drawing import draw, tiled
from tests.world.mechanics.sensing.test_sensing import known
from warp_torchrl.world.arrays.batch import concatenated
from warp_torchrl.world.mechanics.sensing.records import freshness, kept
from warp_torchrl.world.mechanics.sensing.sensing import Sight
from warp_torchrl.world.mechanics.sensing.watching import watching_of
from warp_torchrl.world.state.packets import Named, Packets, moved_up
from warp_torchrl.world.state.state import Action
from warp_torchrl.world.team.radio import Radio
from warp_torchrl.world.team.team import Team

MAP = tiled("...... ......", 2, 2)
FIELD = "TTTTTTa TTTTTTT"


def begun(team, *at, drawing=MAP, worlds=1, sight=None):
    state = team.radio.begun(draw(drawing, team=team, at=list(at), worlds=worlds), flies(team))
    return state if sight is None else sight.begun(state, team)


def later(state, team, *at, sight=None):
    """The worlds a step later, the team at other places, and its packets sent."""
    position = torch.tensor(at).expand_as(state.vehicles.position)
    state = state.replace(step=state.step + 1, vehicles=state.vehicles.replace(position=position))
    state = team.radio.sent(state, flies(team), ~state.done)
    return state if sight is None else sight.updated(state, team, ~state.done)


def flies(team):
    return team.table(torch.device("cpu")).flies


def arriving(state, team):
    return {(i, j) for i, j in team.radio.arriving(state, flies(team))[0].nonzero().tolist()}


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
    team = Team(n_agents=2, radio=Radio(range=3.0, delay=2))
    state = begun(team, (0, 0), (0, 3))  # sent in step 0, in range
    assert arriving(state, team) == set()
    state = later(state, team, (1, 0), (0, 9))  # sent in step 1, out of range
    assert arriving(state, team) == set()
    state = later(state, team, (2, 1), (2, 3))
    assert arriving(state, team) == {(0, 1), (1, 0)}, "of step 0"
    shown = team.radio.observed(state, flies(team))[0]
    assert shown[0, 1].tolist() == [1.0, -2.0, 2.0], "from (2, 1) to (0, 3), where the sender was"
    assert shown[1, 0].tolist() == [1.0, -2.0, -3.0]
    state = later(state, team, (2, 2), (2, 3))
    assert arriving(state, team) == set(), "of step 1, though they are side by side now"
    assert not team.radio.observed(state, flies(team)).any()
    assert arriving(later(state, team, (0, 0), (0, 11)), team) == {(0, 1), (1, 0)}, "of step 2"


@pytest.mark.parametrize("delay", [0, 1, 3])
def test_what_is_lost_is_drawn_when_it_is_sent(delay):
    team = Team(n_agents=3, radio=Radio(loss=0.4, range=6.0, delay=delay))
    state, sent, places = begun(team, (0, 0), (0, 4), (0, 9), worlds=30), [], []
    for step in range(8):
        sent.append(team.radio.heard(state, flies(team)))
        places.append(state.vehicles.position)
        found = team.radio.arriving(state, flies(team))
        assert torch.equal(found, sent[step - delay]) if step >= delay else not found.any()
        assert step < delay or torch.equal(team.radio.places(state), places[step - delay])
        state = later(state, team, (0, 0), (0, step), (1, 9))
    assert sent[0].any() and not torch.equal(sent[0], sent[1])


def test_maps_arrive_so_many_steps_later_as_they_were():
    sight, team = Sight(radius=1), Team(n_agents=2, radio=Radio(carries="map", delay=2))
    at = (0, 0), (0, 5)
    state = begun(team, *at, drawing=FIELD, sight=sight)
    assert known(state, 0)[0] == "TT?????", "step 0"
    state = later(state, team, (0, 0), (0, 3), sight=sight)  # the other sees cells 2 to 4 now
    assert known(state, 0)[0] == "TT?????", "step 1"
    state = later(state, team, *at, sight=sight)
    assert known(state, 0)[0] == "TT??TTa", "step 2: what it knew in step 0"
    assert freshness(kept(state), state.step)[0, 0, 0, 6].item() == pytest.approx(16 / 18)
    state = later(state, team, *at, sight=sight)
    assert known(state, 0)[0] == "TTTTTTa", "step 3: what it knew in step 1"
    assert not watching_of(state).itself[0, 0, 0, 2:].any(), "it was told of it"


def test_news_goes_from_hand_to_hand_and_waits_at_each():
    sight, team = Sight(radius=1), Team(n_agents=3, radio=Radio(carries="map", range=4.0, delay=1))
    at = [(0, 0), (0, 4), (0, 6)]  # the first hears the second, which hears the third
    state, found = begun(team, *at, drawing="TTTTTTTa TTTTTTTT", sight=sight), []
    for _ in range(4):
        found.append([known(state, agent)[0][7] for agent in (2, 1, 0)])
        state = later(state, team, *at, sight=sight)
    # Seen in step 0; the second has it in step 1 and sends it in step 2, so that the first has it in step 3.
    assert found == [["a", "?", "?"], ["a", "a", "?"], ["a", "a", "?"], ["a", "a", "a"]]


@pytest.mark.parametrize("delay", [1, 3])
def test_what_agents_know_is_what_lists_of_all_steps_say(delay):
    """The rule with nothing forgotten: it sends what it knew and what it sees, and knows that and what comes."""
    radio = {"range": 8.0, "loss": 0.3}
    late, silent = (
        small_world(sensing=Sight(radius=2, miss=0.2), team=Team(n_agents=3, radio=Radio(**each)))
        for each in ({"carries": "map", "delay": delay, **radio}, {})
    )
    seeds, episodes = torch.arange(4), torch.zeros(4, dtype=torch.int64)
    state, alone, sent, links = late.reset(seeds, episodes), silent.reset(seeds, episodes), [], []
    knew = torch.zeros_like(kept(state))
    for step in range(12):
        sent.append(torch.maximum(knew, kept(alone)))
        links.append(late.team.radio.heard(state, flies(late.team)))
        knew = sent[-1]
        for i in range(3):
            for j in range(3):
                if step >= delay:
                    came = links[step - delay][:, i, j, None, None] * sent[step - delay][:, j]
                    knew = knew.clone()
                    knew[:, i] = torch.maximum(knew[:, i], came.to(torch.int32))
        assert torch.equal(kept(state), knew)
        action = torch.full((4, 3), int(Action.SOUTH_EAST if step % 3 else Action.EAST))
        state, alone = late.step(state, action).after, silent.step(alone, action).after
    assert not torch.equal(kept(state), kept(alone))


def test_where_others_are_is_told_late_and_seen_at_once():
    team, sight = Team(n_agents=3, radio=Radio(delay=1, range=20.0)), Sight(radius=2)
    state = later(begun(team, (0, 0), (0, 5), (0, 9), sight=sight), team, (0, 1), (0, 3), (0, 10), sight=sight)
    knows, place = sight.knows_where(state, team)
    assert knows[0, 0].tolist() == [False, True, True]
    assert place[0, 0, 1:].tolist() == [[0, 3], [0, 9]], "seen where it is, heard where it was"
    deaf = Team(n_agents=3, radio=Radio(delay=1, range=0.0))
    state = later(begun(deaf, (0, 0), (0, 5), (0, 9), sight=sight), deaf, (0, 1), (0, 3), (0, 10), sight=sight)
    assert sight.knows_where(state, deaf)[0][0, 0].tolist() == [False, True, False]


def test_worlds_that_have_ended_keep_their_packets():
    team = Team(n_agents=2, radio=Radio(carries="map", delay=2))
    world = small_world(team=team, sensing=Sight(), horizon=3)
    state = world.reset(torch.arange(2), torch.zeros(2, dtype=torch.int64))
    for _ in range(3):
        state = world.step(state, torch.zeros(2, 2, dtype=torch.int64)).after
    after = world.step(state, torch.zeros(2, 2, dtype=torch.int64)).after
    assert state.done.all() and all(torch.equal(leaf, after.leaves()[name]) for name, leaf in state.leaves().items())


def test_without_delay_nothing_is_under_way():
    team = Team(n_agents=2, radio=Radio(carries="both", range=4.0))
    world = small_world(team=team, sensing=Sight())
    state = world.reset(torch.arange(2), torch.zeros(2, dtype=torch.int64))
    assert not state.keeps("radio") and not any("radio" in name for name in state.what_changes())
    assert team.radio.sent(state, flies(team), ~state.done) is state
    assert torch.equal(team.radio.places(state), state.vehicles.position)


def test_worlds_of_another_delay_are_refused():
    team = Team(n_agents=2, radio=Radio(delay=2))
    state = begun(team, (0, 0), (0, 3))
    for other, got in (
        (state.without_planes("radio"), 0),
        (begun(Team(n_agents=2, radio=Radio(delay=1)), (0, 0), (0, 3)), 2),
    ):
        with pytest.raises(
            ValueError, match=f"must have the packets of 3 steps where team.radio.delay is 2, got {got}"
        ):
            team.radio.arriving(other, flies(team))
    talking = Radio(delay=2, carries="graph")
    with pytest.raises(ValueError, match="must tell what their agents sent"):
        talking.shown(state)
