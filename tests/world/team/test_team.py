"""The vehicles, action by action, on drawn maps."""

import pytest
import torch
from torch import Tensor

from tests.world.drawing import draw, drawn
from warp_torchrl.world.air.wind import Calm
from warp_torchrl.world.arrays.random import Stream, uniform
from warp_torchrl.world.law.fire import Fire
from warp_torchrl.world.state.cells import count_trees, is_burning
from warp_torchrl.world.state.state import Action, ActionResult, Cover, WorldState
from warp_torchrl.world.team.team import Team
from warp_torchrl.world.terrain.landscape import Perlin
from warp_torchrl.world.world import World

N, NE, E, SE, S, SW, W, NW, EXTINGUISH, CLEAR, STAY = range(11)
UGV, UAV = Team(n_agents=1), Team(n_agents=1, roles=("uav",))
LAST_SPREADING, WET_TICKS = 14, 10


def act(team: Team, state: WorldState, *actions: int, active: bool = True) -> tuple[WorldState, ActionResult]:
    """Let each agent of one world do its action, without a tick."""
    action = torch.tensor([actions])
    return team.act(state, action, torch.tensor([active]), LAST_SPREADING, WET_TICKS)


def mask_of(team: Team, state: WorldState, agent: int = 0) -> set[int]:
    """Return the actions that an agent of the first world is shown."""
    return set(team.action_mask(state, LAST_SPREADING)[0, agent].nonzero().flatten().tolist())


def places(state: WorldState) -> list[tuple[int, int]]:
    return [tuple(place) for place in state.vehicles.position[0].tolist()]


# Moves.

MOVES = {N: (1, 2), NE: (1, 3), E: (2, 3), SE: (3, 3), S: (3, 2), SW: (3, 1), W: (2, 1), NW: (1, 1)}


@pytest.mark.parametrize("action", MOVES)
def test_a_bulldozer_moves_one_cell(action: int) -> None:
    state = draw("..... ..... ..... ..... .....", at=[(2, 2)])
    after, result = act(UGV, state, action)
    assert places(after) == [MOVES[action]]
    assert result.moved.tolist() == [[True]]
    assert after.vehicles.last_action.tolist() == [[action]]


@pytest.mark.parametrize("action", MOVES)
def test_an_aircraft_moves_two_cells(action: int) -> None:
    state = draw("....... ....... ....... ....... .......", team=UAV, at=[(2, 3)])
    after, _ = act(UAV, state, action)
    row, column = MOVES[action]
    assert places(after) == [(2 + 2 * (row - 2), 3 + 2 * (column - 2))]


def test_a_bulldozer_is_stopped_by_the_border_a_lake_and_fire() -> None:
    #  In the corner, lake to the east, fire to the south, embers south-east: nowhere to go.
    state = draw(".~.. ae.. ....")
    assert mask_of(UGV, state) == {EXTINGUISH, STAY}
    for action in MOVES:
        after, result = act(UGV, state, action)
        assert places(after) == [(0, 0)]
        assert result.moved.tolist() == [[False]]


@pytest.mark.parametrize(
    "place, open_moves",
    [
        ((0, 0), {E, SE, S}),
        ((0, 6), {S, SW, W}),
        ((3, 0), {N, NE, E}),
        ((3, 6), {N, W, NW}),
        ((0, 3), {E, SE, S, SW, W}),
    ],
)
def test_nobody_leaves_a_map_that_is_not_square(place: tuple[int, int], open_moves: set[int]) -> None:
    drawing = "....... ....... ....... ......."
    assert mask_of(UGV, draw(drawing, at=[place])) - {STAY} == open_moves
    assert mask_of(UAV, draw(drawing, team=UAV, at=[place])) - {STAY} == open_moves


def test_an_aircraft_one_cell_from_the_border_cannot_cross_it() -> None:
    # From (1, 1) of a 4 x 5 map: row -1 and column -1 are off it.
    state = draw("..... ..... ..... .....", team=UAV, at=[(1, 1)])
    assert mask_of(UAV, state) == {E, SE, S, STAY}


def test_an_aircraft_flies_over_and_onto_lakes_and_fire() -> None:
    state = draw("..... .~a.. ..~a~", team=UAV, at=[(0, 0)])
    after, _ = act(UAV, state, SE)
    assert places(after) == [(2, 2)]
    after, _ = act(UAV, after, NE)
    assert places(after) == [(0, 4)]


def test_a_bulldozer_caught_by_fire_stays_and_may_leave() -> None:
    state = draw("aa. aab ~a.", at=[(1, 1)])
    assert mask_of(UGV, state) == {NE, SE, EXTINGUISH, STAY}
    after, _ = act(UGV, state, NE)
    assert places(after) == [(0, 2)]


def test_bulldozers_may_share_a_cell_and_change_places() -> None:
    team = Team(n_agents=3)
    state = draw(".... ....", team=team, at=[(0, 0), (0, 1), (1, 3)])
    after, _ = act(team, state, E, W, STAY)
    assert places(after) == [(0, 1), (0, 0), (1, 3)]
    after, _ = act(team, state, E, STAY, STAY)
    assert places(after) == [(0, 1), (0, 1), (1, 3)]


def test_agents_move_before_anybody_acts() -> None:
    # Agent 0 puts out the fire that agent 1 wants to drive into: too late for the move.
    team = Team(n_agents=2)
    state = draw(".a.", team=team, at=[(0, 0), (0, 2)])
    after, result = act(team, state, EXTINGUISH, W)
    assert drawn(after) == ".T."
    assert places(after) == [(0, 0), (0, 2)]
    assert result.moved.tolist() == [[False, False]]


# Extinguish.


@pytest.mark.parametrize(
    "before, after",
    [
        ("cdb ..a ...", "cdb ..T ..."),  # the youngest
        ("cdb .b. ...", "cdb .T. ..."),  # of equals the own cell
        (".b. b.b .b.", ".T. b.b .b."),  # then from north-west to south-east
        ("... ..b bb.", "... ..T bb."),
        ("... b.b ...", "... T.b ..."),
        ("... .c. b..", "... .c. T.."),  # age comes before the own cell
        ("eee e.d eee", "eee e.T eee"),  # embers are left
    ],
)
def test_the_youngest_fire_goes_out_own_cell_first_then_in_reading_order(before: str, after: str) -> None:
    state, result = act(UGV, draw(before, at=[(1, 1)]), EXTINGUISH)
    assert drawn(state) == after
    assert result.extinguished.tolist() == [[True]]
    (changed,) = [i for i, (a, b) in enumerate(zip(before.replace(" ", ""), after.replace(" ", ""))) if a != b]
    assert result.target.tolist() == [[changed]]


def test_only_the_3_by_3_neighbourhood_is_in_reach() -> None:
    state = draw("a...a ..... ..... ..... a.a.a", at=[(2, 2)])
    assert EXTINGUISH not in mask_of(UGV, state)
    after, result = act(UGV, state, EXTINGUISH)
    assert drawn(after) == drawn(state)
    assert result.extinguished.tolist() == [[False]]
    assert result.redundant.tolist() == [[False]]


def test_nobody_reaches_over_the_edge_of_the_map() -> None:
    # Fire in the opposite corners and at the far ends of the neighbouring rows.
    for place in ((0, 0), (0, 4), (3, 0), (3, 4), (1, 0), (2, 4)):
        drawing = [list(".....") for _ in range(4)]
        for row in range(4):
            for column in range(5):
                if max(abs(row - place[0]), abs(column - place[1])) > 1:
                    drawing[row][column] = "a"
        state = draw(" ".join("".join(row) for row in drawing), at=[place])
        assert EXTINGUISH not in mask_of(UGV, state)
        assert drawn(act(UGV, state, EXTINGUISH)[0]) == drawn(state)


def test_a_tree_that_is_put_out_is_its_old_age_again_and_wet() -> None:
    state = draw("..... .c... .....", age_on_fire=4, at=[(2, 2)])
    after, _ = act(UGV, state, EXTINGUISH)
    assert drawn(after) == "..... .4... ....."
    wanted = torch.zeros(3, 5, dtype=torch.uint8)
    wanted[1, 1] = 10
    assert torch.equal(after.wet[0], wanted)
    assert torch.equal(after.extinguished[0], wanted > 0)
    assert not after.age.any()
    assert not after.burned.any()


def test_a_tree_that_was_put_out_stays_wet_for_ten_ticks() -> None:
    # Lightning would strike it in every one of them: min(1, 1e6 / 3) = 1.
    fire = Fire(beta=1e6)
    state, _ = act(UGV, draw("..a", at=[(0, 1)]), EXTINGUISH)
    assert drawn(state) == "..T"
    pictures = []
    for _ in range(11):
        state = fire.tick(state, torch.zeros(1, 1, 3), torch.tensor([True]))
        pictures.append(drawn(state))
    assert pictures == ["..T"] * 10 + ["..a"]


@pytest.mark.parametrize("stages, puts_out", [(4, False), (5, True)])
def test_the_last_stage_can_be_put_out_only_if_it_spreads(stages: int, puts_out: bool) -> None:
    state = draw(".e.")
    last = Fire(burning_stages=stages).last_spreading
    after, result = UGV.act(state, torch.tensor([[EXTINGUISH]]), torch.tensor([True]), last, WET_TICKS)
    assert result.extinguished.tolist() == [[puts_out]]
    assert drawn(after) == (".T." if puts_out else ".e.")
    assert UGV.action_mask(state, last)[0, 0, EXTINGUISH].item() is puts_out


def test_both_roles_put_fire_out() -> None:
    after, _ = act(UAV, draw(".a.", team=UAV), EXTINGUISH)
    assert drawn(after) == ".T."


def test_a_tree_can_be_put_out_twice() -> None:
    state, _ = act(UGV, draw("a.", at=[(0, 1)]), EXTINGUISH)
    state = state.replace(cells=torch.tensor([[[12, 0]]], dtype=torch.uint8), age=torch.tensor([[[6, 0]]]).byte())
    state, result = act(UGV, state, EXTINGUISH)
    assert drawn(state) == "6."
    assert result.extinguished.all()
    assert state.extinguished[0, 0].tolist() == [True, False]
    assert state.wet[0, 0].tolist() == [10, 0]


def test_putting_out_may_fail() -> None:
    # 4000 worlds at 0.3: 1200 succeed, deviation 29; five of them, false alarm 6e-7. Failures change nothing.
    team = Team(n_agents=1, extinguish_p=0.3)
    state = draw(".a.", team=team, worlds=4000)
    after, result = team.act(state, torch.full((4000, 1), EXTINGUISH), torch.ones(4000, dtype=torch.bool), 14, 10)
    assert abs(result.extinguished.sum().item() - 1200) < 5 * 29
    assert torch.equal(after.cells[:, 0, 1] == 10, result.extinguished[:, 0])
    assert torch.equal(after.cells[:, 0, 1] == 11, ~result.extinguished[:, 0])
    assert not result.redundant.any()


@pytest.mark.parametrize("p, puts_out", [(0.0, False), (1.0, True)])
def test_certain_success_and_failure_are_certain(p: float, puts_out: bool) -> None:
    team = Team(n_agents=1, extinguish_p=p)
    state = draw(".a.", team=team, worlds=500)
    _, result = team.act(state, torch.full((500, 1), EXTINGUISH), torch.ones(500, dtype=torch.bool), 14, 10)
    assert (result.extinguished == puts_out).all()


def test_the_second_tries_where_the_first_has_failed() -> None:
    # Each succeeds with 1/2: the fire is out in 3/4 of the worlds, credited once; redundant where both succeed, 1/4.
    team = Team(n_agents=2, extinguish_p=0.5)
    state = draw(".a.", team=team, at=[(0, 0), (0, 2)], worlds=4000)
    after, result = team.act(state, torch.full((4000, 2), EXTINGUISH), torch.ones(4000, dtype=torch.bool), 14, 10)
    assert torch.equal(result.extinguished.sum(1) == 1, after.cells[:, 0, 1] == 10)
    assert result.extinguished.sum(1).max() == 1
    # Deviation of both sqrt(4000 * 3 / 16) = 27.4; five of them.
    assert abs((after.cells[:, 0, 1] == 10).sum().item() - 3000) < 137
    assert abs(result.redundant[:, 1].sum().item() - 1000) < 137
    assert not result.redundant[:, 0].any()


# Clear.


def test_clearing_makes_a_firebreak_for_ever() -> None:
    state, result = act(UGV, draw("TTT TTT", at=[(1, 1)]), CLEAR)
    assert drawn(state) == "TTT T.T"
    assert result.cleared.tolist() == [[True]]
    assert result.target.tolist() == [[4]]
    assert state.firebreak[0].tolist() == [[False] * 3, [False, True, False]]
    fire = Fire(growth=True, p_regrow=1.0, beta=1e6)
    for u in (0.5, 0.999, 0.0, 0.999):
        state = fire.tick(state, torch.full((1, 2, 3), u), torch.tensor([True]))
        assert state.cells[0, 1, 1] == 0


@pytest.mark.parametrize("cell", "157T")
def test_a_tree_of_any_age_can_be_cleared(cell: str) -> None:
    assert CLEAR in mask_of(UGV, draw(f"{cell}."))
    assert drawn(act(UGV, draw(f"{cell}."), CLEAR)[0]) == ".."


@pytest.mark.parametrize("cell", ".#~ae")
def test_what_is_no_tree_cannot_be_cleared(cell: str) -> None:
    state = draw(f"{cell}.")
    after, result = act(UGV, state, CLEAR)
    assert CLEAR not in mask_of(UGV, state)
    assert drawn(after) == drawn(state)
    assert torch.equal(after.firebreak, state.firebreak)
    assert result.cleared.tolist() == [[False]]


def test_an_aircraft_cannot_clear() -> None:
    state = draw("TT", team=UAV)
    assert CLEAR not in mask_of(UAV, state)
    after, result = act(UAV, state, CLEAR)
    assert drawn(after) == "TT"
    assert result.cleared.tolist() == [[False]]
    assert after.vehicles.acts.tolist() == [[1]]


def test_a_wet_tree_can_be_cleared_and_is_counted_as_cleared() -> None:
    world = World(landscape=Perlin(size=4), team=Team(n_agents=1), steps_per_tick=1000)
    state = draw("a... .... .... ....", at=[(0, 0)])
    state = world.step(state, torch.tensor([[EXTINGUISH]])).after
    counts = count_trees(state)
    assert (counts.extinguished.item(), counts.cleared.item()) == (1, 0)
    state = state.replace(terminated=torch.tensor([False]))
    state = world.step(state, torch.tensor([[CLEAR]])).after
    counts = count_trees(state)
    assert (counts.extinguished.item(), counts.cleared.item()) == (0, 1)


# Several agents.


def test_one_target_is_credited_to_the_lower_index() -> None:
    team = Team(n_agents=4, roles=("ugv", "uav"))
    state = draw("..... ..a.. .....", team=team, at=[(0, 4), (1, 1), (1, 3), (2, 2)])
    after, result = act(team, state, EXTINGUISH, EXTINGUISH, EXTINGUISH, EXTINGUISH)
    assert drawn(after) == "..... ..T.. ....."
    assert result.extinguished.tolist() == [[False, True, False, False]]  # agent 0 is out of reach
    assert result.redundant.tolist() == [[False, False, True, True]]
    assert after.vehicles.acts.tolist() == [[1, 1, 1, 1]]
    assert after.vehicles.redundant.tolist() == [[0, 0, 1, 1]]
    assert after.wet.sum() == 10


def test_one_tree_is_cleared_once() -> None:
    team = Team(n_agents=2)
    state = draw(".T.", team=team, at=[(0, 1), (0, 1)])
    after, result = act(team, state, CLEAR, CLEAR)
    assert drawn(after) == "..."
    assert result.cleared.tolist() == [[True, False]]
    assert result.redundant.tolist() == [[False, True]]


def test_different_targets_are_all_done() -> None:
    team = Team(n_agents=3)
    state = draw("a...b ..T..", team=team, at=[(0, 1), (0, 3), (1, 2)])
    after, result = act(team, state, EXTINGUISH, EXTINGUISH, CLEAR)
    assert drawn(after) == "T...T ....."
    assert result.extinguished.tolist() == [[True, True, False]]
    assert result.cleared.tolist() == [[False, False, True]]
    assert not result.redundant.any()


def test_an_agent_that_moves_over_a_target_of_another_is_not_redundant() -> None:
    team = Team(n_agents=2)
    state = draw("T.a", team=team, at=[(0, 0), (0, 0)])
    _, result = act(team, state, CLEAR, E)
    assert result.cleared.tolist() == [[True, False]]
    assert result.redundant.tolist() == [[False, False]]


def test_a_second_fire_is_not_taken_by_the_redundant_agent() -> None:
    # Both see the younger fire in the north-west first.
    team = Team(n_agents=2)
    state = draw("a.. ... ..b", team=team, at=[(1, 1), (1, 1)])
    after, result = act(team, state, EXTINGUISH, EXTINGUISH)
    assert drawn(after) == "T.. ... ..b"
    assert result.redundant.tolist() == [[False, True]]


# Tank.


def with_tank(state: WorldState, *water: int, base: tuple[int, int] = (0, 0)) -> WorldState:
    tank = torch.tensor([water], dtype=torch.int32)
    return state.replace(vehicles=state.vehicles.replace(tank=tank, base=torch.tensor([base])))


def test_water_is_spent_on_fire_and_only_then() -> None:
    team = Team(n_agents=1, tank=3)
    state = with_tank(draw("..... ..a.. .....", team=team, at=[(1, 1)]), 3)
    state, _ = act(team, state, STAY)
    assert state.vehicles.tank.tolist() == [[3]]
    state, _ = act(team, state, EXTINGUISH)
    assert state.vehicles.tank.tolist() == [[2]]
    state, _ = act(team, state, EXTINGUISH)  # no fire left
    assert state.vehicles.tank.tolist() == [[2]]


def test_an_empty_tank_puts_nothing_out() -> None:
    team = Team(n_agents=1, tank=3)
    state = with_tank(draw("..... ..a.. .....", team=team, at=[(1, 1)]), 0)
    assert EXTINGUISH not in mask_of(team, state)
    after, result = act(team, state, EXTINGUISH)
    assert drawn(after) == drawn(state)
    assert result.extinguished.tolist() == [[False]]
    assert after.vehicles.tank.tolist() == [[0]]


def test_an_empty_agent_does_not_take_the_credit_from_the_next() -> None:
    team = Team(n_agents=2, tank=3)
    state = with_tank(draw("..... ..a.. .....", team=team, at=[(1, 1), (1, 3)]), 0, 2)
    after, result = act(team, state, EXTINGUISH, EXTINGUISH)
    assert result.extinguished.tolist() == [[False, True]]
    assert result.redundant.tolist() == [[False, False]]
    assert after.vehicles.tank.tolist() == [[0, 1]]


@pytest.mark.parametrize(
    "place, action, filled",
    [
        ((0, 2), STAY, False),  # two cells from the lake
        ((0, 2), E, True),  # moves beside it
        ((2, 4), STAY, False),
        ((1, 3), STAY, True),  # diagonally beside it
        ((2, 0), STAY, True),  # at the base
        ((2, 1), STAY, False),  # beside the base
        ((1, 0), S, True),  # moves to the base
        ((1, 4), S, False),  # leaves the lake
    ],
)
def test_a_tank_fills_beside_a_lake_and_at_the_base(place: tuple[int, int], action: int, filled: bool) -> None:
    team = Team(n_agents=1, tank=5)
    state = with_tank(draw("....~ ..... .....", team=team, at=[place]), 1, base=(2, 0))
    after, _ = act(team, state, action)
    assert after.vehicles.tank.tolist() == [[5 if filled else 1]]


def test_a_lake_across_the_edge_of_the_map_fills_no_tank() -> None:
    team = Team(n_agents=1, tank=5)
    state = with_tank(draw("....~ ..... .....", team=team, at=[(1, 0)]), 1, base=(2, 4))
    assert act(team, state, STAY)[0].vehicles.tank.tolist() == [[1]]


def test_an_aircraft_over_a_lake_fills_its_tank() -> None:
    team = Team(n_agents=1, roles=("uav",), tank=5)
    state = with_tank(draw("~.... ..... .....", team=team, at=[(2, 2)]), 0, base=(2, 4))
    after, _ = act(team, state, NW)
    assert after.vehicles.tank.tolist() == [[5]]


def test_a_redundant_act_spends_water_too() -> None:
    team = Team(n_agents=2, tank=3)
    state = with_tank(draw("..... ..a.. .....", team=team, at=[(1, 1), (1, 3)]), 3, 3)
    after, result = act(team, state, EXTINGUISH, EXTINGUISH)
    assert result.redundant.tolist() == [[False, True]]
    assert after.vehicles.tank.tolist() == [[2, 2]]


def test_without_a_tank_water_is_unlimited() -> None:
    state = draw("a.a a.a", at=[(0, 1)])
    for _ in range(4):
        state, result = act(UGV, state, EXTINGUISH)
        assert result.extinguished.all()
    assert drawn(state) == "T.T T.T"
    assert state.vehicles.tank.tolist() == [[-1]]


# Masks.


def test_a_vehicle_that_can_do_nothing_is_shown_one_action() -> None:
    # Closed in by lakes on bare ground.
    for team, wanted in ((Team(n_agents=1, allow_stay=False), {EXTINGUISH}), (Team(n_agents=1), {STAY})):
        state = draw("~~~ ~.~ ~~~", team=team, at=[(1, 1)])
        assert mask_of(team, state) == wanted
        after, result = act(team, state, EXTINGUISH)
        assert drawn(after) == drawn(state)
        assert not result.extinguished.any()


def test_without_stay_there_are_ten_actions() -> None:
    team = Team(n_agents=2, allow_stay=False)
    assert team.n_actions == 10
    assert team.action_mask(draw("TTT TTT", team=team), LAST_SPREADING).shape == (1, 2, 10)
    assert Team().n_actions == 11


def random_action(team: Team, state: WorldState) -> Tensor:
    u = uniform(state.key, state.step, Stream.POLICY, (team.n_agents,))
    return (u * team.n_actions).to(torch.int64)


MAPS_AND_PLACE = ("cells", "age", "extinguished", "burned", "firebreak", "wet", "vehicles.position")


def changed_worlds(before: WorldState, after: WorldState) -> Tensor:
    """Return in which worlds a map or a position is not what it was, bool [B]."""
    old, new = before.leaves(), after.leaves()
    return torch.stack([(old[name] != new[name]).flatten(1).any(dim=1) for name in MAPS_AND_PLACE]).any(dim=0)


@pytest.mark.parametrize(
    "team",
    [
        Team(n_agents=3, roles=("ugv", "uav")),
        Team(n_agents=2, roles=("uav", "ugv"), tank=2, start="anywhere"),
    ],
    ids=["mixed", "tanks"],
)
def test_an_action_does_something_exactly_where_the_mask_allows_it(team: Team) -> None:
    # One agent acts and the others stay, in worlds that random steps have stirred.
    world = World(landscape=Perlin(size=(11, 14)), wind=Calm(), team=team, steps_per_tick=2)
    state = world.reset(torch.arange(48), torch.zeros(48, dtype=torch.int64))
    seen = torch.zeros(team.n_actions, 2, dtype=torch.int64)
    for _ in range(12):
        for _ in range(4):
            state = world.step(state, random_action(team, state)).after
        active = ~state.done
        mask = world.action_mask(state)
        for agent in range(team.n_agents):
            for action in range(team.n_actions - 1):
                actions = torch.full((48, team.n_agents), STAY)
                actions[:, agent] = action
                after, _ = team.act(state, actions, active, LAST_SPREADING, WET_TICKS)
                allowed = mask[:, agent, action] & active
                assert torch.equal(changed_worlds(state, after), allowed), Action(action).name
                seen[action] += torch.stack((allowed.sum(), (~allowed).sum()))
    assert (seen[:STAY] > 0).all()


def test_without_masks_all_is_open_and_what_is_not_possible_does_nothing() -> None:
    team = Team(n_agents=2, allow_stay=False)
    world, open_world = (World(landscape=Perlin(size=12), team=team, action_masking=each) for each in (True, False))
    state = world.reset(torch.arange(16), torch.zeros(16, dtype=torch.int64))
    possible = world.action_mask(state)
    assert torch.equal(open_world.possible_actions(state), possible) and not possible.all()
    assert open_world.action_mask(state).shape == possible.shape and open_world.action_mask(state).all()
    blocked = possible.to(torch.uint8).argmin(dim=-1)
    assert not open_world.team.act(state, blocked, ~state.done, LAST_SPREADING, WET_TICKS)[1].credited.any()


def test_stay_changes_nothing() -> None:
    state = draw("TaT TTT", at=[(1, 1)])
    assert not changed_worlds(state, act(UGV, state, STAY)[0]).any()


def test_the_mask_without_stay_is_the_mask_with_it_and_never_empty() -> None:
    stays, never_stays = Team(n_agents=2), Team(n_agents=2, allow_stay=False)
    world = World(landscape=Perlin(size=12, levels=(0.5, 0.6, 0.7)), team=stays)
    state = world.reset(torch.arange(64), torch.zeros(64, dtype=torch.int64))
    with_stay, without = stays.action_mask(state, 14), never_stays.action_mask(state, 14)
    stuck = ~with_stay[..., :10].any(dim=-1)
    assert without.any(dim=-1).all()
    assert torch.equal(without[~stuck], with_stay[~stuck][:, :10])
    assert with_stay[..., STAY].all()


# Start, counters and frozen worlds.


def test_counters_count_chosen_acts_and_not_moves() -> None:
    state = draw("T.. ...", at=[(0, 0)])
    for action in (CLEAR, CLEAR, EXTINGUISH, E, STAY):
        state, _ = act(UGV, state, action)
    assert state.vehicles.acts.tolist() == [[3]]
    assert state.vehicles.last_action.tolist() == [[STAY]]


def test_in_a_world_that_has_ended_nobody_does_anything() -> None:
    state = draw("Ta. ...", at=[(0, 0)])
    for action in range(11):
        after, result = act(UGV, state, action, active=False)
        assert all(torch.equal(plane, state.leaves()[name]) for name, plane in after.leaves().items())
        assert not (result.moved | result.extinguished | result.cleared | result.redundant).any()


def place(team: Team, drawing: str, worlds: int) -> WorldState:
    state = draw(drawing, worlds=worlds)
    return state.replace(vehicles=team.place(state.key, state.landscape.cover, is_burning(state.cells)))


def test_a_team_starts_in_a_corner_each_on_a_cell_of_its_own() -> None:
    state = place(Team(n_agents=4), "...... ...... ...... ...... ......", 200)
    corners = {tuple(base) for base in state.vehicles.base.tolist()}
    assert corners == {(0, 0), (0, 5), (4, 0), (4, 5)}
    away = (state.vehicles.position - state.vehicles.base[:, None]).abs().amax(-1)
    # The corner and the three cells round it.
    assert (away.sort(dim=1).values == torch.tensor([0, 1, 1, 1])).all()
    assert all(len({tuple(cell) for cell in world}) == 4 for world in state.vehicles.position.tolist())


def test_a_team_starts_neither_in_a_lake_nor_in_fire() -> None:
    drawing = "~~..~~ ~a..a~ ...... ~a..a~ ~~..~~"
    for start in ("corner", "anywhere"):
        state = place(Team(n_agents=5, start=start), drawing, 100)
        row, column = state.vehicles.position.unbind(-1)
        cells = state.cells[torch.arange(100)[:, None], row, column]
        cover = state.landscape.cover[torch.arange(100)[:, None], row, column]
        assert not is_burning(cells).any()
        assert (cover != Cover.LAKE).all()
        assert all(len({tuple(cell) for cell in world}) == 5 for world in state.vehicles.position.tolist())


def test_a_team_may_start_anywhere() -> None:
    # 5 x 4 cells, one agent: each cell about 4000 / 20 = 200 times, deviation 13.8; five of them.
    state = place(Team(n_agents=1, start="anywhere"), ".... .... .... .... ....", 4000)
    row, column = state.vehicles.position[:, 0].unbind(-1)
    assert (torch.bincount(row * 4 + column, minlength=20) - 200).abs().max() < 69


def test_a_start_is_a_function_of_the_key_alone() -> None:
    for start in ("corner", "anywhere"):
        team = Team(n_agents=3, start=start)
        batch, alone = place(team, ".... .... .... ....", 40), draw(".... .... .... ....", seed=33)
        alone = team.place(alone.key, alone.landscape.cover, is_burning(alone.cells))
        assert torch.equal(batch.vehicles.position[33:34], alone.position)
        assert torch.equal(batch.vehicles.base[33:34], alone.base)


def test_agents_are_named_and_numbered_by_role() -> None:
    team = Team(n_agents=5, roles=("ugv", "uav"))
    assert team.agent_names == ["bulldozer_0", "uav_0", "bulldozer_1", "uav_1", "bulldozer_2"]
