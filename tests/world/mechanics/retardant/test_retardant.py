"""Aircraft with retardant, by hand and in the scenario."""

import pytest
import torch

from tests.world.drawing import differing, draw
from warp_torchrl import make_env
from warp_torchrl.world.law.lattice import LatticeFire
from warp_torchrl.world.mechanics.retardant.retardant import Missions, RetardantTeam
from warp_torchrl.world.team.places import approach_move, from_middle, has_reached, nearest_mate
from warp_torchrl.world.world import World

NORTH_EAST, EAST, WEST, STAY = 1, 2, 6, 10
LAW = LatticeFire()


def act(team, state, *actions):
    return team.act(state, torch.tensor([actions]), torch.tensor([True]), LAW.last_spreading, LAW.wet_for, [team])


def over(drawing, *at, **options):
    team = RetardantTeam(n_agents=len(at), **options)
    return team, begun(drawing, team, *at)


def begun(drawing, team, *at):
    return team.begin(draw(drawing, fire=LAW, team=team, at=list(at)), World(team=team))


def arrived(state):
    return state.planes("retardant", Missions).arrived.tolist()


@pytest.mark.parametrize(("treats", "wet", "left"), [("path", [1, 1, 0], 3), ("end", [0, 1, 0], 4)])
def test_an_aircraft_treats_what_it_leaves_and_what_it_comes_to(treats, wet, left):
    team, state = over("aaT", (0, 0), tank=5, treats=treats)
    after, result = act(team, state, EAST)
    assert after.wet[0].tolist() == [wet] and after.cells[0].tolist() == [[11, 11, 10]], "it puts nothing out"
    assert after.vehicles.tank.tolist() == [[left]] and after.vehicles.acts.tolist() == [[1]]
    assert result.credited.tolist() == [[True]] and result.target.tolist() == [[1]]
    after, result = act(team, after, EAST)
    assert after.wet[0].tolist() == [wet], "a healthy tree is not treated"
    assert result.redundant.tolist() == [[treats == "path"]] and after.vehicles.position.tolist() == [[[0, 2]]]


def test_an_aircraft_that_stays_treats_its_tree_once():
    team, state = over("aT", (0, 0), tank=5)
    after, _ = act(team, state, STAY)
    assert after.vehicles.tank.tolist() == [[4]] and after.wet.tolist() == [[[1, 0]]]


def test_of_two_over_a_tree_both_spend_and_the_first_is_credited():
    team, state = over("aTT", (0, 0), (0, 0), tank=5)
    after, result = act(team, state, STAY, STAY)
    assert after.wet.tolist() == [[[1, 0, 0]]] and after.vehicles.tank.tolist() == [[4, 4]]
    assert result.credited.tolist() == [[True, False]] and result.redundant.tolist() == [[False, True]]
    assert after.vehicles.redundant.tolist() == [[0, 1]]


def test_with_its_last_drop_an_aircraft_is_back_at_its_base_with_a_full_tank():
    drawing = " ".join(["aaTTTTT"] + ["TTTTTTT"] * 6)
    team, state = over(drawing, (0, 0), tank=3)
    assert state.vehicles.base.tolist() == [[2, 4]], "the fifth row from the south, the fifth column"
    after, _ = act(team, state, EAST)
    assert after.vehicles.tank.tolist() == [[1]] and arrived(after) == [[True]]
    after, _ = act(team, after, WEST)
    assert after.vehicles.position.tolist() == [[[2, 4]]] and after.vehicles.tank.tolist() == [[3]]
    assert arrived(after) == [[False]] and after.wet[0, 0, :2].tolist() == [1, 1]


def test_without_tanks_retardant_does_not_run_out_and_with_empty_ones_there_is_none():
    team, state = over("aa", (0, 0))
    for action in (EAST, WEST) * 20:
        state, _ = act(team, state, action)
    assert state.vehicles.tank.tolist() == [[-1]] and state.vehicles.acts.tolist() == [[40]]
    team, state = over("aa", (0, 0), tank=0)
    after, result = act(team, state, EAST)
    assert not after.wet.any() and not result.credited.any() and after.vehicles.position.tolist() == [[[0, 1]]]


def test_bulldozers_of_a_mixed_team_drop_nothing():
    team = RetardantTeam(n_agents=2, roles=("ugv", "tanker"))
    assert team.agent_names == ["bulldozer_0", "tanker_0"]
    after, _ = act(team, begun("aTa", team, (0, 0), (0, 2)), STAY, STAY)
    assert after.wet[0].tolist() == [[0, 0, 1]]


def test_worlds_that_have_ended_stay_as_they_are():
    team, state = over("aaT", (0, 0), tank=1)
    after, _ = team.act(state, torch.tensor([[EAST]]), torch.tensor([False]), LAW.last_spreading, LAW.wet_for, [team])
    assert not differing(after, state)


def test_an_aircraft_has_reached_the_fire_until_it_sets_out_again():
    team, state = over("TaT", (0, 0))
    assert has_reached(state).tolist() == [[False]]
    state, _ = act(team, state, EAST)
    assert has_reached(state).tolist() == [[True]]
    for _ in range(2):
        state, _ = act(team, state, EAST)
        assert state.vehicles.position.tolist() == [[[0, 2]]] and has_reached(state).tolist() == [[True]]
    burnt = state.replace(burned=torch.ones_like(state.burned), cells=torch.zeros_like(state.cells))
    forgot = burnt.with_planes("retardant", Missions(torch.tensor([[False]])))
    assert has_reached(forgot).tolist() == [[True]], "burnt trees count"


def test_the_way_to_the_middle_is_diagonal_and_then_along_the_axis_with_north_before_east():
    # 6 x 6: the middle is between rows 2, 3 and columns 2, 3.
    state = over(" ".join(["TTTTTT"] * 6), (0, 0), (5, 0), (3, 0), (0, 3))[1]
    assert from_middle(state)[0].tolist() == [[-2.5, 2.5], [-2.5, -2.5], [-2.5, -0.5], [0.5, 2.5]]
    # From (3, 0) east and north-east both end 2 cells from the middle, along rows and columns; east is preferred.
    assert approach_move(state).tolist() == [[3, NORTH_EAST, EAST, 4]]


def test_aircraft_that_approach_are_shown_one_action_until_they_arrive():
    team, state = over(" ".join(["TTTTTT"] * 5 + ["aTTTTT"]), (0, 0), (5, 0), approach=True)
    shown = team.action_mask(state, LAW.last_spreading, [team])[0]
    assert shown[0].nonzero().flatten().tolist() == [3]
    assert shown[1].nonzero().flatten().tolist() == [0, 1, 2, STAY]


def test_the_nearest_team_mate_is_the_first_of_those_as_near():
    assert nearest_mate(over("TTTTT", (0, 0), (0, 1), (0, 2), (0, 4))[1]).tolist() == [[1, 0, 1, 2]]
    assert nearest_mate(over("T", (0, 0))[1]).tolist() == [[0]]


SMALL = ["landscape.size=16", "team.n_agents=3", "team.tank=4", "horizon=120"]


def played(n_worlds, seed, steps=40):
    env = make_env("haksar", n_worlds=n_worlds, seed=seed, overrides=SMALL)
    now = env.reset()
    for step in range(steps):
        actions = torch.arange(3).add(step * 7).remainder(8).expand(n_worlds, 3)
        now = env.step(now.set(("agents", "action"), actions.contiguous()))["next"]
    return env.world_state


def test_the_same_seed_gives_the_same_worlds_and_two_at_once_are_those_of_one_by_one():
    both = played(2, 5)
    assert differing(both[:1], both[1:])
    for index in range(2):
        assert not differing(both[torch.tensor([index])], played(1, 5 + index))
    assert both.burned.any() and both.vehicles.acts.any()


def test_the_scenario_is_the_lattice_of_the_authors():
    env = make_env("haksar", n_worlds=3)
    env.reset()
    state, counts = env.world_state, env.tree_counts
    assert counts.initial.tolist() == [2500] * 3 and counts.alight.tolist() == [16] * 3
    assert (state.cells[:, 23:27, 23:27] == 11).all()
    assert state.vehicles.position.shape == (3, 10, 2) and env.world.steps_per_tick == 6
    assert state.vehicles.base.tolist() == [[45, 4]] * 3
