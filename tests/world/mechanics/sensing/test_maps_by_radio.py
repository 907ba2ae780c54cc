"""Maps that agents of limited sight tell each other by radio, at once and late."""

import pytest
import torch

from tests.conftest import small_world
from tests.world.mechanics.drawing import begun, known, later
from warp_torchrl.world.mechanics.sensing.sensing import Sight
from warp_torchrl.world.mechanics.sensing.watching import memory_of
from warp_torchrl.world.state.records import freshness, kept, known_codes
from warp_torchrl.world.state.state import EMBER, Action
from warp_torchrl.world.team.team import Team

Radio = pytest.importorskip("warp_torchrl.world.mechanics.radio.radio").Radio
FIELD = "TTTTTTa TTTTTTT"


def rules(n_agents, sight=None, **radio):
    return small_world(
        team=Team(n_agents=n_agents), sensing=sight or Sight(radius=1), mechanics=(Radio(**radio),), horizon=12
    )


def test_maps_are_told_to_those_that_hear_and_the_newer_record_counts():
    world, at = rules(3, carries="map", range=4.0), [(0, 0), (0, 4), (0, 6)]
    first = begun(world, *at, drawing=FIELD)  # the first hears the second, which hears the third
    assert known(first, 0) == ["TT?TTT?", "TT?TTT?"], "of the third it has not heard yet"
    assert known(first, 1) == ["TT?TTTa", "TT?TTTT"]
    then = later(first, world)
    assert known(then, 0) == ["TT?TTTa", "TT?TTTT"], "from hand to hand, one a step"
    assert freshness(kept(then), then.step)[0, 0, 0, 6].item() == pytest.approx(16 / 17)
    alone = begun(rules(3, carries="graph"), *at, drawing=FIELD)
    assert known(alone, 1) == ["???TTT?", "???TTT?"]


def test_without_range_nothing_is_shared():
    state = begun(rules(2, carries="map", range=0.0), (0, 0), (0, 6), drawing=FIELD)
    assert known(state, 0) == ["TT?????", "TT?????"]


def test_who_was_told_of_the_front_has_no_part_in_watching_it():
    world = rules(2, carries="map")
    state = begun(world, (0, 6), (0, 3), drawing=FIELD)
    assert memory_of(state).watches[0].tolist() == memory_of(state).finds[0].tolist() == [1.0, 0.0]
    state = later(state, world, (0, 3), (0, 6))
    assert memory_of(state).watches[0].tolist() == [0.0, 1.0], "the credit passes to who sees it again"
    assert memory_of(state).finds[0].tolist() == [0.0, 0.0]


def test_maps_arrive_so_many_steps_later_as_they_were():
    world, at = rules(2, carries="map", delay=2), [(0, 0), (0, 5)]
    state = begun(world, *at, drawing=FIELD)
    assert known(state, 0)[0] == "TT?????", "step 0"
    state = later(state, world, (0, 0), (0, 3))  # the other sees cells 2 to 4 now
    assert known(state, 0)[0] == "TT?????", "step 1"
    state = later(state, world, *at)
    assert known(state, 0)[0] == "TT??TTa", "step 2: what it knew in step 0"
    assert freshness(kept(state), state.step)[0, 0, 0, 6].item() == pytest.approx(16 / 18)
    state = later(state, world, *at)
    assert known(state, 0)[0] == "TTTTTTa", "step 3: what it knew in step 1"
    assert not memory_of(state).itself[0, 0, 0, 2:].any(), "it was told of it"


def test_news_goes_from_hand_to_hand_and_waits_at_each():
    world = rules(3, carries="map", range=4.0, delay=1)
    at = [(0, 0), (0, 4), (0, 6)]  # the first hears the second, which hears the third
    state, found = begun(world, *at, drawing="TTTTTTTa TTTTTTTT"), []
    for _ in range(4):
        found.append([known(state, agent)[0][7] for agent in (2, 1, 0)])
        state = later(state, world, *at)
    # Seen in step 0; the second has it in step 1 and sends it in step 2, so that the first has it in step 3.
    assert found == [["a", "?", "?"], ["a", "a", "?"], ["a", "a", "?"], ["a", "a", "a"]]


@pytest.mark.parametrize("delay", [1, 3])
def test_what_agents_know_is_what_lists_of_all_steps_say(delay):
    """The rule with nothing forgotten: it sends what it knew and what it sees, and knows that and what comes."""
    radio = {"range": 8.0, "loss": 0.3}
    late, silent = (
        rules(3, Sight(radius=2, miss=0.2), **each) for each in ({"carries": "map", "delay": delay, **radio}, {})
    )
    flies = late.team.table(torch.device("cpu")).flies
    seeds, episodes = torch.arange(4), torch.zeros(4, dtype=torch.int64)
    state, alone, sent, links = late.reset(seeds, episodes), silent.reset(seeds, episodes), [], []
    knew = torch.zeros_like(kept(state))
    for step in range(11):
        sent.append(torch.maximum(knew, kept(alone)))
        links.append(late.hearing.heard(state, flies))
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
    def knows_where(radio_range):
        world = rules(3, Sight(radius=2), delay=1, range=radio_range)
        state = begun(world, (0, 0), (0, 5), (0, 9), drawing="............")
        state = later(state, world, (0, 1), (0, 3), (0, 10))
        return world.sensing.knows_where(state, world.team, world.hearing)

    knows, place = knows_where(20.0)
    assert knows[0, 0].tolist() == [False, True, True]
    assert place[0, 0, 1:].tolist() == [[0, 3], [0, 9]], "seen where it is, heard where it was"
    assert knows_where(0.0)[0][0, 0].tolist() == [False, True, False]


def test_worlds_that_have_ended_keep_their_packets():
    world = rules(2, carries="map", delay=2)
    state = world.reset(torch.arange(2), torch.zeros(2, dtype=torch.int64))
    for _ in range(12):
        state = world.step(state, torch.zeros(2, 2, dtype=torch.int64)).after
    after = world.step(state, torch.zeros(2, 2, dtype=torch.int64)).after
    assert state.done.all() and all(torch.equal(leaf, after.leaves()[name]) for name, leaf in state.leaves().items())


def test_a_world_keeps_what_its_agents_know_and_watch_in_any_batch():
    world = rules(2, Sight(radius=2, smoke=1.0, miss=0.1, false_alarm=0.01), carries="both")
    seeds, episodes = torch.arange(4), torch.zeros(4, dtype=torch.int64)
    state, alone = world.reset(seeds, episodes), world.reset(seeds[2:3], episodes[2:3])
    for step in range(11):
        action = torch.full((4, 2), int(Action.SOUTH_EAST if step % 3 else Action.EXTINGUISH))
        state, alone = world.step(state, action).after, world.step(alone, action[2:3]).after
    for name, leaf in memory_of(state).leaves().items():
        assert torch.equal(leaf[2:3], memory_of(alone).leaves()[name]), name
    assert (known_codes(state) <= EMBER).all() and "extras.sensing.records" in state.what_changes()
