"""Vehicles that join and leave, on drawn maps and in play."""

import pytest
import torch

from tests.conftest import small_world
from tests.world.drawing import differing, drawn
from tests.world.mechanics.drawing import begun
from tests.world.mechanics.there import needs
from warp_torchrl import load_policy, make_env
from warp_torchrl.env.observation.critic import CriticState, reach_of_fire_and_team
from warp_torchrl.env.pictures.render import render
from warp_torchrl.env.reward.terms import _at_head, _surrounded
from warp_torchrl.heuristics import HEURISTICS
from warp_torchrl.heuristics.base import claim_cells
from warp_torchrl.heuristics.firebreaks import cells_to_clear
from warp_torchrl.system.device import unread
from warp_torchrl.world.air.wind import Calm
from warp_torchrl.world.law.fire import Fire
from warp_torchrl.world.mechanics.arrivals.arrivals import Arrivals, Presence
from warp_torchrl.world.team.places import nearest_mate
from warp_torchrl.world.team.team import Team

CLEAR, STAY = 9, 10
LATE = Arrivals(minutes={"bulldozer_1": 20.0})  # after two steps of ten minutes


def rules(arrivals=LATE, **changes):
    parts = {"fire": Fire(youngest_fuel=1), "wind": Calm(), "steps_per_tick": 1, "team": Team(n_agents=2)}
    return small_world(mechanics=(arrivals,), **{**parts, **changes})


def at_start(world, *at, drawing="TTTT~TTa", **options):
    return begun(world, *at, drawing=drawing, fire=world.fire, **options)


def presence(state):
    return state.planes("arrivals", Presence)


def test_who_is_not_there_does_nothing_whatever_is_chosen():
    world = rules(action_masking=False)
    state = at_start(world, (0, 0), (0, 2))
    first = world.step(state, torch.tensor([[CLEAR, CLEAR]]))
    assert drawn(first.after).startswith(".TTT") and first.result.action.tolist() == [[CLEAR, STAY]]
    assert first.after.vehicles.acts.tolist() == [[1, 0]]
    second = world.step(first.after, torch.tensor([[2, 2]])).after
    assert second.vehicles.position[0].tolist() == [[0, 1], [0, 2]] and presence(second).present.all()
    assert drawn(world.step(second, torch.tensor([[STAY, CLEAR]])).after).startswith(".T.T")


def test_the_mask_of_who_is_not_there_opens_stay_alone():
    world = rules()
    mask = world.action_mask(at_start(world, (0, 0), (0, 2)))[0]
    assert mask[1].nonzero().flatten().tolist() == [STAY] and mask[0, CLEAR]


def test_others_do_not_see_meet_or_reckon_with_who_is_not_there():
    world = rules(team=Team(n_agents=3), arrivals=Arrivals(minutes={"bulldozer_1": 20.0}))
    state = at_start(world, (0, 0), (0, 1), (0, 3))
    known, _ = world.sensing.knows_where(state, world.team, world.hearing)
    assert known[0].tolist() == [[False, False, True], [False] * 3, [True, False, False]]
    assert not world.hearing.arriving(state, torch.zeros(3, dtype=torch.bool))[0, :, 1].any()
    assert nearest_mate(state)[0].tolist() == [2, 1, 0]
    apart = at_start(world, (0, 0), (0, 3), (0, 6))
    claims = claim_cells(apart, torch.tensor([[2, 5]]), torch.zeros(1, 1, 2), spacing=0, discount=0.0, taken=100.0)
    assert claims[0].tolist() == [[0, 2], [0, 3], [0, 5]], "the second claims nothing"
    for _ in range(2):
        state = world.step(state, torch.full((1, 3), STAY)).after
    known, _ = world.sensing.knows_where(state, world.team, world.hearing)
    assert known.sum() == 6 and nearest_mate(state)[0].tolist() == [1, 0, 1]


def test_critic_pictures_and_rewards_leave_out_who_is_not_there():
    world = rules(team=Team(n_agents=2, roles=("ugv", "uav")), arrivals=Arrivals(minutes={"uav": 20.0}))
    field = " ".join(["T" * 24] * 11 + ["T" * 11 + "aa" + "T" * 11] * 2 + ["T" * 24] * 11)
    state = at_start(world, (2, 2), (20, 20), drawing=field)
    later = world.step(world.step(state, torch.full((1, 2), STAY)).after, torch.full((1, 2), STAY)).after
    critic = CriticState(world)
    of_each = [critic.names.index(role) for role in world.team.role_names]
    counts = [critic(each, world.forecast(each))[0, of_each].sum((1, 2)).tolist() for each in (state, later)]
    assert counts == [[1.0, 0.0], [1.0, 1.0]]
    near, far = (reach_of_fire_and_team(each, world)[1][0, -1, -1].item() for each in (later, state))
    assert near > 0.1 > 0.001 > far
    flies = torch.tensor([False, True])
    bare, drawing, both = (
        render(each, who)[0, 200:, 200:] for each, who in ((state, None), (state, flies), (later, flies))
    )
    assert torch.equal(bare, drawing) and not torch.equal(render(later, None)[0, 200:, 200:], both)
    assert [_surrounded(each).item() for each in (state, later)] == [1 / 8, 2 / 8]
    calm = [
        each.replace(air=each.air.replace(wind=torch.tensor([1.0, -1.0]).view(1, 2, 1, 1))) for each in (state, later)
    ]
    assert [_at_head(each).item() for each in calm] == [0.0, 0.5]


def test_a_firebreak_is_planned_with_those_who_are_there():
    world = rules(team=Team(n_agents=2, tank=0), steps_per_tick=8)
    field = " ".join(["T" * 15] * 7 + ["T" * 7 + "a" + "T" * 7] + ["T" * 15] * 7)
    state, clears = at_start(world, (6, 4), (14, 14), drawing=field), torch.tensor([True, True])
    alone = cells_to_clear(state.without_planes("arrivals"), world, torch.tensor([True, False]), 2.0)
    together = cells_to_clear(state.without_planes("arrivals"), world, clears, 2.0)
    assert torch.equal(cells_to_clear(state, world, clears, 2.0), alone) and not torch.equal(together, alone)


def test_agents_are_told_when_they_come_and_go_and_how_many_still_come():
    world = rules(
        Arrivals(minutes={"ugv": 90.0, "bulldozer_0": 0.0}, stays={"bulldozer_0": 30.0}), team=Team(n_agents=3)
    )
    state = at_start(world, (0, 0), (0, 1), (0, 2))
    told = world.mechanics[0].status(state)[0].tolist()
    assert told[0] == [1.0, 0.0, 0.5, 1.0] and told[1] == [0.0, 1.5, 0.0, 0.5] and told[2] == told[1]
    soon = world.mechanics[0].critic(state, 2)
    assert soon.sum().item() == pytest.approx(2 * 2.718281828**-1.5)
    for _ in range(3):
        state = world.step(state, torch.full((1, 3), STAY)).after
    assert world.mechanics[0].status(state)[0, 0].tolist() == [0.0, 3.0, 0.0, 1.0], "it does not come back"


def test_a_vehicle_travels_from_its_station_and_joins_at_the_nearest_dry_cell():
    arrivals = Arrivals(stations={"ugv": (-100.0, 4.0)}, minutes={"ugv": 2.0}, speeds={"ugv": 30.0}, detour=1.5)
    world = rules(arrivals, team=Team(n_agents=3, roles=("ugv", "ugv", "uav")))
    state = at_start(world, (0, 0), (0, 1), (0, 7))
    # The lake is nearest; (0, 3) and (0, 5) are 3 km away, 6 minutes at 30 km/h, by road 9.
    assert presence(state).entry[0].tolist() == [[0, 3], [0, 5], [0, 7]]
    assert presence(state).arrives[0].tolist() == pytest.approx([11.0, 11.0, 0.0], abs=0.01)
    assert state.vehicles.position[0].tolist() == [[0, 3], [0, 5], [0, 7]]


def test_a_vehicle_leaves_and_comes_back_to_where_it_joined_with_a_full_tank():
    arrivals = Arrivals(stays={"bulldozer_0": 20.0}, away={"bulldozer_0": 10.0})
    world = rules(arrivals, team=Team(n_agents=2, tank=4))
    state = at_start(world, (1, 1), (1, 2), drawing="TTTT#TTa TTTT#TTa TTTT#TTa")
    state = state.replace(vehicles=state.vehicles.replace(tank=torch.ones_like(state.vehicles.tank)))
    east = torch.tensor([[2, STAY]])
    there = []
    for _ in range(4):
        state = world.step(state, east).after
        there.append((presence(state).present[0, 0].item(), state.vehicles.position[0, 0, 1].item()))
    assert there == [(True, 2), (False, 1), (True, 1), (True, 2)]
    assert state.vehicles.tank.tolist() == [[4, 1]]
    metrics = arrivals.metrics(state)
    assert metrics["on_scene"].item() == pytest.approx(7 / 8) and metrics["first_arrival"].item() == 0.0


def test_the_first_arrival_counts_until_now_where_nobody_has_come():
    world = rules(Arrivals(minutes={"ugv": 25.0}))
    state = at_start(world, (0, 0), (0, 1))
    seen = []
    for _ in range(4):
        state = world.step(state, torch.full((1, 2), STAY)).after
        seen.append(world.mechanics[0].metrics(state)["first_arrival"].item())
    assert seen == [10.0, 20.0, 25.0, 25.0]


def test_drawn_times_are_a_world_s_own_in_any_batch_and_where_nothing_is_read():
    world = rules(Arrivals(minutes={"ugv": 30.0}, variation=0.5))
    many, few = (at_start(world, (0, 0), (0, 1), worlds=n) for n in (200, 3))
    arrives = presence(many).arrives
    assert arrives.median().item() == pytest.approx(30.0, rel=0.15) and len(arrives.unique()) == 400
    # log(1 + 0.5^2) = 0.47^2
    assert arrives.log().std().item() == pytest.approx(0.47, abs=0.06)
    stay = torch.full((200, 2), STAY)
    for _ in range(3):
        many, few = world.step(many, stay).after, world.step(few, stay[:3]).after
    assert not differing(many[:3], few)
    with unread():
        again = at_start(world, (0, 0), (0, 1), worlds=3)
        for _ in range(3):
            again = world.step(again, stay[:3]).after
    assert not differing(few, again)


def test_a_policy_and_the_baselines_play_with_a_team_that_comes_bit_by_bit():
    late = "mechanics.arrivals.minutes={bulldozer_2:8,bulldozer_3:900}"
    policy = load_policy("default", mode="deterministic")
    env = make_env("spread_default", n_worlds=2, overrides=[late, *policy.overrides])
    policy = policy.fitted(env)
    shown = env.rollout(8, policy, break_when_any_done=False)
    action, mask = shown["agents", "action"], shown["agents", "action_mask"]
    assert mask.gather(-1, action[..., None]).all() and (action[:, :, 3] == STAY).all()
    assert (action[:, :, :2] != STAY).any() and env.channel_names["status"][-4:] == (
        "is_there",
        "hours_until_there",
        "hours_until_gone",
        "others_to_come",
    )
    # Of steps of two minutes two vehicles are there in all eight, and one in the last four.
    assert shown["next", "info", "on_scene"][:, -1, 0].tolist() == pytest.approx([20 / 32] * 2)
    view, names = shown["agents", "observation", "view"][:, 0], env.channel_names["view"]
    for name in ("coordinated", "dispatch", "random"):
        played = env.rollout(8, HEURISTICS[name](env), break_when_any_done=False)["agents", "action"]
        assert (played[:, :, 3] == STAY).all() and (played[:, :, 0] != STAY).any()
    assert set(view[..., names.index("other_ugv"), :, :].flatten(2).sum(-1)[:, :2].unique().tolist()) == {63}


@needs("sensing")
def test_who_is_not_there_sees_nothing():
    sensing = pytest.importorskip("warp_torchrl.world.mechanics.sensing.sensing")
    from warp_torchrl.world.state.records import freshness, kept

    world = rules(sensing=sensing.Sight(radius=1))
    state = at_start(world, (0, 0), (0, 6))
    fresh = freshness(kept(state), state.step)[0]
    assert fresh[0, 0, :2].tolist() == [1.0, 1.0] and not fresh[1].any()


@needs("flight")
def test_aircraft_that_are_not_there_use_no_charge_and_are_nobody_s_near_miss():
    flight = pytest.importorskip("warp_torchrl.world.mechanics.flight.flight").Flight(battery=9, separation=3.0)
    team = Team(n_agents=2, roles=("uav",))
    world = rules(Arrivals(minutes={"uav_1": 10.0}), team=team)
    world = small_world(mechanics=(*world.mechanics, flight), fire=world.fire, wind=Calm(), steps_per_tick=1, team=team)
    state, seen = at_start(world, (0, 3), (0, 3), drawing="TTTTTTTTa"), []
    for _ in range(2):
        state = world.step(state, torch.full((1, 2), STAY)).after
        flown = state.extras.held["flight"]
        seen.append((flown.battery[0].tolist(), flown.near_misses[0].tolist()))
    assert seen == [([8, 9], [0, 0]), ([7, 8], [1, 1])]


def test_pictures_say_how_many_are_there():
    world = small_world(mechanics=(LATE,), fire=Fire(youngest_fuel=1), wind=Calm(), steps_per_tick=1)
    state, said = at_start(world, (0, 0), (0, 1), drawing="TTTTTTTTTTTTTa"), []
    for _ in range(3):
        said += LATE.caption(state)
        state = world.step(state, torch.full((1, 2), STAY)).after
    assert said == ["1 of 2 vehicles there"] * 2 + ["2 of 2 vehicles there"]


@needs("values")
def test_only_who_is_there_costs():
    values = pytest.importorskip("warp_torchrl.world.mechanics.values.values").Values()
    world = small_world(mechanics=(LATE, values), fire=Fire(youngest_fuel=1), wind=Calm(), steps_per_tick=1)
    state = at_start(world, (0, 0), (0, 1), drawing="TTTTTTTTTTTTTa")
    for _ in range(4):
        state = world.step(state, torch.full((1, 2), STAY)).after
    # One bulldozer of 250 dollars an hour for 40 minutes; the other after the second and later steps, 30.
    assert values.metrics(state)["cost"].item() == pytest.approx(250 * 70 / 60)


def test_what_does_not_fit_is_refused():
    with pytest.raises(ValueError, match="allow_stay must be true where vehicles join and leave"):
        rules(team=Team(n_agents=2, allow_stay=False))
    with pytest.raises(
        ValueError, match=r"arrivals\.minutes must name roles or agents of the team, .* did you mean ugv"
    ):
        rules(Arrivals(minutes={"ugw": 1.0}))
    with pytest.raises(ValueError, match=r"minutes\.ugv must be in"):
        Arrivals(minutes={"ugv": -1.0})
    with pytest.raises(ValueError, match="detour must be in"):
        Arrivals(detour=0.5)
