"""What agents know of the fire."""

import math

import pytest
import torch

from tests.conftest import small_world
from tests.world.drawing import CELLS, draw
from warp_torchrl.world.mechanics.sensing.records import freshness, kept, known_codes
from warp_torchrl.world.mechanics.sensing.sensing import Full, Sight, others_in_sight
from warp_torchrl.world.state.state import EMBER, FIRST_FIRE, Action
from warp_torchrl.world.team.radio import Radio
from warp_torchrl.world.team.team import Team

TWO = Team(n_agents=2)
FIELD = "TTTTTTT TTTTTTT TTTTTTT TTTTTTT TTTTTTT TTTTTTT TTTTTaa"


def started(sensing, team=TWO, at=((0, 0), (6, 6)), drawing=FIELD, worlds=1, **options):
    return sensing.begun(draw(drawing, team=team, at=list(at), worlds=worlds, **options), team)


def known(state, agent, world=0):
    """The map of an agent as a drawing, a question mark where it has never been."""
    fresh = freshness(kept(state), state.step)[world, agent]
    codes = known_codes(state)[world, agent]
    return ["".join(CELLS[c] if f > 0 else "?" for c, f in zip(*row)) for row in zip(codes.tolist(), fresh.tolist())]


def running(state):
    return torch.ones_like(state.done)


def moved(state, agent, place):
    position = state.vehicles.position.clone()
    position[:, agent] = torch.tensor(place)
    return state.replace(vehicles=state.vehicles.replace(position=position), step=state.step + 1)


def test_an_agent_knows_what_is_within_its_radius():
    state = started(Sight(radius=1))
    assert known(state, 0) == ["TT?????", "TT?????", "???????", "???????", "???????", "???????", "???????"]
    assert known(state, 1)[-2:] == ["?????TT", "?????aa"]
    assert (known_codes(state)[0, 0] == 10).all(), "what it has not seen it knows from the map, without the fire"


def test_roles_see_as_far_as_they_are_said_to():
    team = Team(n_agents=2, roles=("scout", "ugv"))
    sight = Sight(radius=0, radius_of={"scout": 6})
    state = started(sight, team)
    assert "?" not in "".join(known(state, 0)) and "".join(known(state, 1)).count("?") == 48
    assert others_in_sight(state, sight.reach(team))[0].tolist() == [[False, True], [False, False]]


def test_what_was_seen_is_kept_and_grows_old():
    sight = Sight(radius=1)
    state = started(sight)
    seen = moved(state, 1, (0, 3)).replace(cells=torch.full_like(state.cells, 10))
    seen = sight.updated(seen, TWO, running(seen))
    assert known(seen, 1)[-1] == "?????aa", "the fire is out, and it has not seen that"
    assert known(seen, 1)[0] == "??TTT??"
    assert freshness(kept(seen), seen.step)[0, 1, 6, 6].item() == pytest.approx(16 / 17)
    back = moved(seen, 1, (6, 6))
    assert known(sight.updated(back, TWO, running(back)), 1)[-1] == "?????TT"


def test_maps_are_told_to_those_that_hear_and_the_newer_record_counts():
    sight, team = Sight(radius=1), Team(n_agents=3, radio=Radio(carries="map", range=4.0))
    at = [(0, 0), (0, 4), (0, 6)]  # the first hears the second, which hears the third
    state = draw("TTTTTTa TTTTTTT", team=team, at=at)
    first = sight.begun(state, team)
    assert known(first, 0) == ["TT?TTT?", "TT?TTT?"], "of the third it has not heard yet"
    assert known(first, 1) == ["TT?TTTa", "TT?TTTT"]
    later = first.replace(step=first.step + 1)
    later = sight.updated(later, team, running(later))
    assert known(later, 0) == ["TT?TTTa", "TT?TTTT"], "from hand to hand, one a step"
    assert freshness(kept(later), later.step)[0, 0, 0, 6].item() == pytest.approx(16 / 17)
    alone = sight.begun(state, Team(n_agents=3, radio=Radio(carries="graph")))
    assert known(alone, 1) == ["???TTT?", "???TTT?"]


def test_without_range_nothing_is_shared():
    team = Team(n_agents=2, radio=Radio(carries="map", range=0.0))
    state = started(Sight(radius=1), team)
    assert known(state, 0)[0] == "TT?????" and known(state, 0)[-1] == "???????"


def test_worlds_that_have_ended_stay_as_they_are():
    sight = Sight(radius=1)
    state = started(sight, worlds=2)
    now = moved(state, 0, (0, 4))
    after = sight.updated(now, TWO, torch.tensor([True, False]))
    assert known(after, 0, 0)[0] == "TT?TTT?" and known(after, 0, 1)[0] == "TT?????"


@pytest.mark.parametrize(
    ("sight", "expected"),
    [
        (Sight(radius=1, miss=1.0), ["?????TT", "?????TT"]),  # the trees that they were
        (Sight(radius=1, false_alarm=1.0), ["?????aa", "?????aa"]),
    ],
)
def test_errors_of_sight(sight, expected):
    assert known(started(sight), 1)[-2:] == expected


def test_errors_come_with_their_chance_and_are_each_agents_own():
    sight = Sight(radius=6, miss=0.25, false_alarm=0.1)
    burning = " ".join(["aaaaaaa"] * 3 + ["TTTTTTT"] * 4)
    state = started(sight, drawing=burning, worlds=200, at=((3, 3), (3, 3)))
    codes = known_codes(state)
    missed = (codes[:, :, :3] == 10).float().mean().item()
    alarms = (codes[:, :, 3:] == FIRST_FIRE).float().mean().item()
    assert abs(missed - 0.25) < 0.02  # 8400 draws: 4.2 standard deviations
    assert abs(alarms - 0.1) < 0.012  # 11 200 draws: 4.2 standard deviations
    assert (codes[:, 0] != codes[:, 1]).any()
    assert torch.equal(
        started(sight, drawing=burning, worlds=2, at=((3, 3), (3, 3))).plane("sensing", "records"), kept(state)[:2]
    )


def test_smoke_hides_cells_by_the_law_of_beer_and_lambert():
    sight = Sight(radius=1, smoke=0.5, smoke_length=2)
    state = started(sight, Team(n_agents=1), [(0, 1)], "aTT TTT TTT", worlds=3000, wind=(5.0, 0.0))
    seen = (freshness(kept(state), state.step)[:, 0, 0] == 1.0).float().mean(dim=0).tolist()
    for share, amount in zip(seen, (1.0, 1 / 2, 1 / 3)):
        assert abs(share - math.exp(-0.5 * amount)) < 0.04  # 3000 draws: over 4 standard deviations
    assert (freshness(kept(state), state.step)[:, 0, 1] == 1.0).all(), "where no smoke is"


def test_full_sensing_keeps_no_maps():
    world = small_world()
    assert isinstance(world.sensing, Full) and not world.reset(torch.arange(2), torch.zeros(2).long()).keeps("sensing")


def test_a_world_keeps_what_its_agents_know():
    sight, team = Sight(radius=2, smoke=1.0, miss=0.1, false_alarm=0.01), Team(n_agents=2, radio=Radio(carries="both"))
    world = small_world(sensing=sight, team=team)
    seeds, episodes = torch.arange(4), torch.zeros(4, dtype=torch.int64)
    state, alone = world.reset(seeds, episodes), world.reset(seeds[2:3], episodes[2:3])
    for step in range(12):
        action = torch.full((4, 2), int(Action.SOUTH_EAST if step % 3 else Action.EXTINGUISH))
        state, alone = world.step(state, action).after, world.step(alone, action[2:3]).after
    assert torch.equal(kept(alone), kept(state)[2:3])
    assert (known_codes(state) <= EMBER).all()
    assert "extras.sensing.records" in state.what_changes()


@pytest.mark.parametrize(
    ("wrong", "rule"),
    [
        ({"radius": -1}, "radius must be in"),
        ({"radius_of": {"drone": 3}}, "radius_of must name roles of"),
        ({"radius_of": {"uav": 900}}, r"radius_of.uav must be in"),
        ({"miss": 1.5}, "miss must be in"),
        ({"smoke_length": 0}, "smoke_length must be in"),
    ],
)
def test_what_cannot_be_is_refused(wrong, rule):
    with pytest.raises(ValueError, match=rule):
        Sight(**wrong)
