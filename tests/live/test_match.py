"""One fire and those who fight it."""

import pytest
import torch

from warp_torchrl.demonstrations.recording import Mover
from warp_torchrl.live.crew import Refused
from warp_torchrl.live.match import Match, Setting
from warp_torchrl.live.order import Order
from warp_torchrl.runs.config.construction import ConfigError
from warp_torchrl.world.state.cells import is_tree
from warp_torchrl.world.state.state import Action


def run(match, steps):
    for _ in range(steps):
        match.step()


def same(one, other):
    leaves = other.state.leaves()
    return all(leaf.equal(leaves[name]) for name, leaf in one.state.leaves().items())


def test_the_same_policy_twice_is_the_same_fire_twice(make_match):
    match = make_match("random", beside="random")
    run(match, 15)
    assert same(*match.sides) and not same(match.sides[0], match.alone)


def test_a_team_that_does_nothing_is_the_fire_without_a_team(make_match):
    match = make_match("noop")
    run(match, 15)
    assert same(match.sides[0], match.alone)


def test_a_start_anew_is_the_same_and_another_seed_is_not(make_match):
    match = make_match()
    before = match.alone.state.clone()
    run(match, 9)
    match.restart()
    assert before.cells.equal(match.alone.state.cells)
    match.restart(match.setting.seed + 1)
    assert not before.cells.equal(match.alone.state.cells)


def test_curves_have_a_number_for_the_start_and_for_each_step(make_match):
    match = make_match()
    run(match, 7)
    side = match.sides[0]
    assert len(side.curves.saved) == len(side.curves.burning) == 8
    assert side.curves.saved[-1] == float(side.env.tree_counts.saved()[0])


def test_acts_of_the_vehicles_add_up_to_the_credited_ones(make_match):
    match = make_match()
    seen = []
    side, count = match.sides[0], match.sides[0].env.watcher
    side.env.watcher = lambda transition: (seen.append(transition.result.extinguished[0].clone()), count(transition))
    run(match, 30)
    assert torch.stack(seen).sum(0).equal(side.curves.extinguished) and side.curves.extinguished.sum() > 0


def test_each_side_sees_what_its_policy_was_trained_to_see_in_the_same_world():
    match = Match(Setting(policy="local", beside="default", overrides=("scenario=default",)))
    assert [side.env.observation.radius for side in match.sides] == [3, 3]
    assert match.sides[0].world is match.sides[1].world is match.alone.world


def test_who_is_on_a_vehicle_is_obeyed_and_the_others_go_on(make_match):
    match = make_match()
    side = match.sides[0]
    side.crew.take(0, person=1)
    open_move = int(side.possible[0, :8].to(torch.uint8).argmax())
    before = side.state.vehicles.position[0].clone()
    side.crew.press(0, 1, open_move)
    assert match.step() == []
    assert int(side.state.vehicles.last_action[0, 0]) == open_move
    assert not side.state.vehicles.position[0, 0].equal(before[0])
    assert int(side.facing[0]) == open_move
    side.crew.press(0, 1, int(Action.STAY))
    match.step()
    assert int(side.facing[0]) == open_move, "it faces where it last moved"


def test_a_driven_vehicle_puts_out_a_cell(make_match):
    match = make_match("noop")
    side = match.sides[0]
    row, column = side.state.vehicles.position[0, 0].tolist()
    while not is_tree(side.state.cells)[0, row, column]:  # it may have started on bare ground
        match.restart(match.setting.seed + 1)
        row, column = side.state.vehicles.position[0, 0].tolist()
    match.ignite(row, column)
    side.crew.take(0, person=1)
    side.crew.press(0, 1, int(Action.EXTINGUISH))
    assert match.step() == []
    assert int(side.curves.extinguished[0]) == 1 and bool(side.state.extinguished[0, row, column])


def test_the_match_waits_for_a_word_and_proposes_the_same(make_match):
    match = make_match("random", seed=5)
    side = match.sides[0]
    side.crew.ask_before([name for name in side.env.action_names])
    asked = match.questions()
    assert len(asked) == 3 and match.step() == [] and int(side.state.step[0]) == 0
    assert match.questions() == asked
    for question in asked:
        side.crew.answer(question, allow=question.agent != 1)
    match.step()
    done = side.state.vehicles.last_action[0].tolist()
    assert int(side.state.step[0]) == int(match.alone.state.step[0]) == 1
    assert done == [asked[0].action, int(Action.STAY), asked[2].action]


def test_a_vehicle_that_is_sent_comes_to_its_sector_and_stays_there():
    match = Match(Setting(policy="random", overrides=("scenario=default", "ignition.count=1", "fire=spread")))
    side = match.sides[0]
    start = side.state.vehicles.position[0, 0]
    size = match.world.size[0]
    goal = [12 if each < size / 2 else size - 13 for each in start.tolist()]
    side.order(0, Order(row=goal[0], column=goal[1], radius=2))
    gaps = []
    for _ in range(60):
        match.step()
        gaps.append(int(side.crew.seats[0].order.distance(side.state.vehicles.position[0, 0])))
    assert min(gaps) <= 2, gaps
    arrived = next(at for at, gap in enumerate(gaps) if gap <= 2)
    assert max(gaps[arrived:]) <= 2


def test_an_order_is_obeyed_at_once_though_a_question_was_open(make_match):
    match = make_match("random")
    side = match.sides[0]
    side.crew.ask_before(side.env.action_names)
    match.questions()
    side.order(0, Order(row=15, column=15, radius=0))
    left = side.mask[0]
    assert all(left[question.action] for question in match.questions() if question.agent == 0)


def test_a_match_waits_where_its_policy_is_unsure_and_records_what_a_person_chose(make_match):
    match = make_match("default")
    side = match.sides[0]
    side.ask_where_unsure(1.0)
    while not (questions := match.questions()):
        match.step()
    at = int(side.state.step[0])
    match.step()
    assert int(side.state.step[0]) == at, "a question is open"
    for question in questions:
        assert question.chance == pytest.approx(float(side.chances[question.agent].max()))
        side.crew.answer(question, True)
    match.step()
    row = side.record().steps[-1]
    people = (row["agents", "mover"] == Mover.PERSON).nonzero()[:, 0].tolist()
    assert people == sorted(each.agent for each in questions)
    assert row["agents", "action"].equal(row["agents", "proposed"])


def test_a_baseline_cannot_tell_how_sure_it_is(make_match):
    match = make_match("local")
    with pytest.raises(Refused, match="local has no action probabilities"):
        match.sides[0].ask_where_unsure(0.5)
    match.sides[0].ask_where_unsure(None)
    assert match.sides[0].crew.unsure_below is None


# The world


def test_a_wind_is_held_on_all_sides_until_the_next_start(make_match):
    match = make_match(overrides=("wind=wandering",))
    own = match.alone.state.wind.clone()
    match.blow(speed=9.0, direction=90.0)
    run(match, 12)
    for side in match.everywhere:
        assert torch.allclose(side.state.wind.flatten(), torch.tensor([0.0, 9.0]), atol=1e-5)
    match.restart()
    assert all(side.state.wind.equal(own) for side in match.everywhere)
    run(match, 12)
    assert not match.alone.state.wind.equal(own), "the scenario's wind wanders again"


def test_a_wind_beyond_the_scale_is_refused_and_changes_nothing(make_match):
    match = make_match()
    before = match.alone.state
    with pytest.raises(ValueError, match="speed"):
        match.blow(speed=61.0, direction=0.0)
    assert match.alone.state is before


@pytest.mark.parametrize("act", ["ignite", "clear"])
def test_a_cell_is_lit_or_cleared_on_all_sides(make_match, act):
    match = make_match(beside="noop")
    # The tree farthest from where the team and the fire are: any that the middle row has.
    row, column = (is_tree(match.alone.state.cells[0]) & (match.alone.state.cells[0] > 3)).nonzero()[-1].tolist()
    getattr(match, act)(row, column)
    codes = {int(side.state.cells[0, row, column]) for side in match.everywhere}
    assert codes == ({11} if act == "ignite" else {0})
    assert len(match.alone.curves.saved) == 1
    run(match, 3)
    assert len(match.alone.curves.saved) == 4


def test_a_cell_that_cannot_be_lit_or_cleared_is_refused(make_match):
    match = make_match()
    row, column = (match.alone.state.cells[0] == 0).nonzero()[0].tolist()
    with pytest.raises(Refused, match=f"cell {row}, {column} holds no dry tree"):
        match.ignite(row, column)
    with pytest.raises(Refused, match=f"cell {row}, {column} holds no tree to clear"):
        match.clear(row, column)
    with pytest.raises(Refused, match="cell 16, 0 is not on the map of 16 x 16 cells"):
        match.ignite(16, 0)


def test_when_the_time_is_up_nothing_can_be_lit(make_match):
    match = make_match("noop", ("horizon=2",))
    run(match, 2)
    assert match.ended
    with pytest.raises(Refused, match="the episode is over"):
        match.ignite(0, 0)


def test_the_fire_goes_on_after_a_team_is_done(make_match):
    match = make_match("noop", ("horizon=40",))
    side = match.sides[0]
    side.shown = side.env.set_state(side.state.replace(terminated=torch.tensor([True])))
    run(match, 3)
    assert int(match.alone.state.step[0]) == 3 and int(match.sides[0].state.step[0]) == 0 and not match.ended


def test_a_mistake_in_an_override_is_one_line_with_its_key():
    with pytest.raises(ConfigError, match=r"team\.n_agents must be in"):
        Match(Setting(policy="local", overrides=("team.n_agents=0",)))
    with pytest.raises(ValueError, match="seed"):
        Setting(seed=-1)
