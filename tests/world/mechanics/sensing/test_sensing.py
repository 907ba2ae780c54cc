"""What agents know of the fire."""

import math

import pytest
import torch

from tests.conftest import small_world
from tests.world.mechanics.drawing import begun, known, later
from warp_torchrl.world.mechanics.sensing.sensing import Sight, others_in_sight
from warp_torchrl.world.state.records import freshness, kept, known_codes
from warp_torchrl.world.state.state import FIRST_FIRE
from warp_torchrl.world.team.team import Team

TWO = Team(n_agents=2)
FIELD = "TTTTTTT TTTTTTT TTTTTTT TTTTTTT TTTTTTT TTTTTTT TTTTTaa"
CORNERS = (0, 0), (6, 6)


def rules(sight, team=TWO):
    return small_world(sensing=sight, team=team)


def started(sight, team=TWO, at=CORNERS, drawing=FIELD, worlds=1, **options):
    return begun(rules(sight, team), *at, drawing=drawing, worlds=worlds, **options)


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
    world = rules(Sight(radius=1))
    state = begun(world, *CORNERS, drawing=FIELD)
    out = " ".join(["TTTTTTT"] * 7)
    seen = later(state, world, (0, 0), (0, 3), drawing=out)
    assert known(seen, 1)[-1] == "?????aa", "the fire is out, and it has not seen that"
    assert known(seen, 1)[0] == "??TTT??"
    assert freshness(kept(seen), seen.step)[0, 1, 6, 6].item() == pytest.approx(16 / 17)
    assert known(later(seen, world, *CORNERS, drawing=out), 1)[-1] == "?????TT"


def test_worlds_that_have_ended_stay_as_they_are():
    world = rules(Sight(radius=1))
    state = begun(world, *CORNERS, drawing=FIELD, worlds=2)
    after = later(state, world, (0, 4), (6, 6), running=[True, False])
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


def test_smoke_that_no_known_fire_explains_points_to_its_source():
    # The fire at (0, 0) hides (0, 1) and (0, 2), which agent 0 would see: 1/2 + 1/3 point to (0, 0), upwind of both.
    sight = Sight(radius=1, smoke=100.0, smoke_length=2)
    state = started(sight, TWO, [(0, 2), (2, 6)], "aTTTTTT TTTTTTT TTTTTTT", wind=(5.0, 0.0))
    nothing = torch.zeros(1, 2, 3, 7)
    own, others = sight.signs(state, TWO, nothing)[0]
    assert own[0].tolist() == [pytest.approx(5 / 6), 1.0, 1.0, 0.0, 0.0, 0.0, 0.0]
    assert not own[1:].any() and not others.any()
    assert torch.equal(sight.signs(state, TWO, nothing[:, :1])[0, 0], own), "of a team, what any agent would see"
    known = nothing.index_fill(3, torch.tensor([0]), 1.0)
    assert not sight.signs(state, TWO, known).any(), "a known fire explains it"
    assert Sight(radius=1).signs(state, TWO, nothing) is None


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
