"""What fires do to assets, what escapes and what it costs, by hand."""

from dataclasses import dataclass

import pytest
import torch
from torch import Tensor

from tests.conftest import small_world
from tests.world.drawing import differing
from tests.world.mechanics.drawing import begun
from warp_torchrl.system.device import unread
from warp_torchrl.world.air.wind import Calm, Uniform
from warp_torchrl.world.arrays.batch import Batch
from warp_torchrl.world.law.fire import Fire
from warp_torchrl.world.law.fronts import front_at
from warp_torchrl.world.law.rate import RateFire
from warp_torchrl.world.mechanics.values.response import HOMES, LEVELS, lost
from warp_torchrl.world.mechanics.values.values import Exposure, Values
from warp_torchrl.world.team.team import Team

SPREAD = Fire(youngest_fuel=1)
RATE = RateFire(cell_deviation=0.0, fuel_of_cover=(98, 102, 104, 145, 99), minutes_per_tick=2.0)
STAY = 10


def played(values, steps, drawing, ground="", fire=SPREAD, worlds=1, steps_per_tick=1, assets=None):
    """Drawn worlds of two bulldozers after some steps in which nobody acts, and their metrics."""
    wind = Uniform(speed=8.0) if fire is RATE else Calm()
    world = small_world(mechanics=(values,), fire=fire, wind=wind, steps_per_tick=steps_per_tick, horizon=20)
    given = {"drawing": drawing, "ground": ground, "fire": fire, "worlds": worlds}
    given |= {"wind": (8.0, 0.0)} if fire is RATE else {}
    state = begun(world, (0, 0), (0, 0), **given)
    if assets is not None:
        land = state.landscape.with_layers(assets=torch.tensor(assets).expand(worlds, -1, -1))
        state = values.begin(state.replace(ground=state.ground.replace(landscape=land)), world)
    state = fire.started(state)
    for _ in range(steps):
        state = world.step(state, torch.full((worlds, 2), STAY)).after
    return state, {name: metric[0].item() for name, metric in values.metrics(state).items()}


def test_losses_go_by_the_six_levels_of_flame_length():
    feet = torch.tensor([0.0, 0.1, 1.9, 2.0, 3.9, 5.0, 7.0, 11.9, 12.1, 100.0])
    assert lost(feet * 0.3048, HOMES).tolist() == pytest.approx([0, 0.25, 0.25, 0.4, 0.4, 0.55, 0.7, 0.85, 1, 1])
    assert [foot * 0.3048 for foot in (2, 4, 6, 8, 12)] == pytest.approx(LEVELS)


def test_what_the_fire_meets_loses_its_share_once():
    # Flames of 3 m are of the fifth level: 0.85 of a house worth 3 is lost, that worth 1 behind the break stands.
    values = Values(points=((0, 1, 3.0), (0, 4, 1.0)))
    for steps in (1, 9):
        assert played(values, steps, "aT.TT")[1]["worth_saved"] == pytest.approx((3 * 0.15 + 1) / 4)
    assert played(values, 0, "aT.TT")[1]["worth_saved"] == 1.0
    assert played(Values(points=((0, 1, 3.0),), losses=(0, 0, 0, 0, 0.5, 0)), 3, "aTT")[1]["worth_saved"] == 0.5
    assert played(Values(points=((9, 9, 1.0),)), 3, "aTT")[1]["worth_saved"] == 1.0, "nothing stands on the map"


def test_a_raster_and_trees_are_worth_something_too():
    # All of the five trees but the last burn; then one that the raster says to be worth 2 of 3.
    assert played(Values(), 6, "aTTT.T")[1]["worth_saved"] == pytest.approx(1 - 4 / 5 * 0.85)
    assert played(Values(), 6, "aTT.T", assets=[[0.0, 0, 2, 0, 1]])[1]["worth_saved"] == pytest.approx(1 - 2 / 3 * 0.85)


def test_pictures_show_what_is_left_of_each_asset_and_say_it():
    values = Values(points=((0, 1, 3.0), (0, 4, 1.0)), escape_area=0.1)
    state, _ = played(values, 3, "aT.TT")
    assert values.buildings(state)[0, 0].tolist() == pytest.approx([-1.0, 0.15, -1.0, -1.0, 1.0])
    # (3 x 0.15 + 1) of 4, and two cells of 30 m.
    assert values.caption(state) == ("36% of worth left", "fire 0.2 ha, escaped")
    assert Values().buildings(played(Values(), 3, "aT.TT")[0]) is None, "each tree is worth the same"
    raster, _ = played(Values(), 3, "aT.TT", assets=[[0.0, 0, 0, 2, 0]])
    assert Values().buildings(raster)[0, 0].tolist() == [-1.0, -1.0, -1.0, 1.0, -1.0]


@pytest.mark.parametrize(("reach", "left"), [(30.0, 0.15), (29.0, 1.0)])
def test_a_house_on_bare_ground_is_exposed_to_flames_near_it(reach, left):
    ground = "ggbgg"
    assert played(Values(points=((0, 2, 1.0),), reach=reach), 3, "aT.TT", ground)[1]["worth_saved"] == pytest.approx(
        left
    )
    beyond = played(Values(points=((0, 3, 1.0),), reach=reach), 3, "aT..T", "ggbbg")[1]
    assert beyond["worth_saved"] == 1.0, "60 m away"


def test_embers_ignite_what_stands_where_they_fall():
    @dataclass(eq=False, repr=False)
    class Fallen(Batch):
        falls: Tensor

    values, world = Values(points=((0, 3, 1.0),), ember_chance=0.2), small_world()
    state = begun(small_world(mechanics=(values,)), (0, 0), (0, 0), drawing="a..T")
    state = state.with_planes("embers", Fallen(torch.full((1, 1, 4), 127, dtype=torch.uint8)))
    for _ in range(2):
        state = values.after_tick(state, torch.tensor([True]), world)
    state = values.after_tick(state, torch.tensor([False]), world)
    among = state[torch.zeros(3, dtype=torch.int64)]  # one that does not tick among others that do
    others = torch.tensor([True, False, True])
    with unread():
        unlisted = values.after_tick(among, others, world).planes("values", Exposure).left
    assert torch.equal(values.after_tick(among, others, world).planes("values", Exposure).left, unlisted)
    assert unlisted[1] == state.planes("values", Exposure).left[0] > unlisted[0]
    assert values.metrics(state)["worth_saved"].item() == pytest.approx((1 - 0.2 * 127 / 255) ** 2)


def test_a_fire_that_has_nowhere_to_go_is_contained_when_it_last_grew():
    # Two cells more in two ticks of 10 minutes, then only ash: 3 cells of 0.09 ha.
    for steps in (4, 8):
        found = played(Values(), steps, "aTT.T")[1]
        assert (found["contained"], found["contained_at"]) == (1.0, 20.0)
        assert found["fire_size"] == pytest.approx(0.27)
    growing = played(Values(minutes_per_tick=6.0), 4, "aTTTTTTTTT")[1]
    assert (growing["contained"], growing["contained_at"]) == (0.0, 24.0)
    wet = played(Values(), 1, "aT.T")[0]
    wet = wet.replace(cells=torch.tensor([[[11, 10, 0, 10]]], dtype=torch.uint8), wet=torch.full_like(wet.wet, 9))
    held = Values().after_tick(wet, torch.tensor([True]), small_world(mechanics=(Values(),), fire=SPREAD))
    assert not held.planes("values", Exposure).held.any(), "what is wet dries"


@pytest.mark.parametrize(("limit", "escaped"), [(0.27, 0.0), (0.26, 1.0)])
def test_a_fire_over_the_limit_has_escaped(limit, escaped):
    assert played(Values(escape_area=limit), 4, "aTT.T")[1]["escaped"] == escaped


def test_vehicles_cost_by_the_hour_until_the_fire_is_out():
    # A tick of five steps is 10 minutes: of two bulldozers 250 and 700 dollars an hour, 12 steps are 0.4 hours.
    for rates, hourly in (({}, 500.0), ({"ugv": 700.0}, 1400.0)):
        found = played(Values(rates=rates), 12, "aTTTT.TTT", steps_per_tick=5)[1]
        assert found["cost"] == pytest.approx(0.4 * hourly)
    out = played(Values(), 15, "a.T")
    assert out[0].terminated.all() and out[1]["cost"] == pytest.approx(5 * 10 / 60 * 500)


def test_under_law_rate_a_house_meets_the_front_as_it_came():
    drawing, ground = " ".join(["TTTaTTTT"] * 4), " ".join(["ffffffff"] * 4)
    values = Values(points=((1, 5, 1.0),))
    state, found = played(values, 12, drawing, ground, RATE)
    cell = torch.tensor([[1 * 8 + 5]])
    flames = front_at(RATE, state, cell.expand(1, 64).flatten()).flame_length[:1]
    assert flames.item() > 0.5 and state.planes("values", Exposure).flames[0, 1, 5] == pytest.approx(flames.item())
    assert found["worth_saved"] == pytest.approx(1.0 - lost(flames, HOMES).item())
    assert found["contained_at"] <= 24.0 and not state.planes("values", Exposure).flames[0, 0].any()


@pytest.mark.parametrize("fire", [SPREAD, RATE], ids=["spread", "rate"])
def test_a_world_is_the_same_in_any_batch_and_where_nothing_is_read(fire):
    drawing, ground = " ".join(["TTTaTTTT"] * 4), " ".join(["ffffffff"] * 4)
    values = Values(houses=5)
    many, few = (played(values, 6, drawing, ground, fire, worlds=n)[0] for n in (6, 3))
    assert not differing(many[:3], few)
    assert (few.planes("values", Exposure).worth.flatten(1).sum(1) == 5).all()
    assert not torch.equal(*few.planes("values", Exposure).worth[:2])
    with unread():
        assert not differing(few, played(values, 6, drawing, ground, fire, worlds=3)[0])


def test_what_does_not_fit_is_refused():
    for given, told in (
        ({"losses": (0.0,) * 5 + (1.5,)}, r"losses must be in \[0, 1\]"),
        ({"points": ((0, 0, -1.0),)}, "points must be worth 0 or more, got -1"),
        ({"houses": -1}, "houses must be in"),
    ):
        with pytest.raises(ValueError, match=told):
            Values(**given)
    with pytest.raises(ValueError, match=r"values\.minutes_per_tick is read under laws without minutes"):
        small_world(mechanics=(Values(minutes_per_tick=5.0),), fire=RateFire())
    with pytest.raises(ValueError, match=r"values\.flame_length is read under other laws than rate alone"):
        small_world(mechanics=(Values(flame_length=2.0),), fire=RateFire())
    with pytest.raises(ValueError, match=r"values\.rates must name roles, got ugw: did you mean ugv\?"):
        small_world(mechanics=(Values(rates={"ugw": 1.0}),))


def test_a_role_without_a_rate_is_refused(monkeypatch):
    monkeypatch.delitem(__import__("warp_torchrl.world.mechanics.values.response", fromlist=["RATES"]).RATES, "scout")
    with pytest.raises(ValueError, match=r"values\.rates must name each role of the team, got none for scout"):
        small_world(mechanics=(Values(),), team=Team(n_agents=2, roles=("scout",)))


def test_houses_may_stand_down_the_wind_alone():
    # The fire is in column 1, and the wind goes to the east: columns 4 to 6 are 3 to 5 cells away.
    drawing = " ".join(["TTTTTTTTT"] * 4 + ["TaTTTTTTT"] + ["TTTTTTTTT"] * 4)
    for wind, place in (((5.0, 0.0), (slice(0, 9), slice(4, 7))), ((0.0, -5.0), (slice(7, 9), slice(0, 7)))):
        world = small_world(mechanics=(Values(houses=5, downwind=(3.0, 5.0)),), fire=SPREAD, wind=Uniform(speed=5.0))
        state = begun(world, (0, 0), (0, 0), drawing=drawing, ground="", fire=SPREAD, worlds=3, wind=wind)
        worth = state.planes("values", Exposure).worth
        assert worth.flatten(1).sum(1).tolist() == [5.0] * 3 == worth[:, *place].flatten(1).sum(1).tolist()
        assert not torch.equal(worth[0], worth[1])
    with pytest.raises(ValueError, match="downwind is read with houses"):
        Values(downwind=(1.0, 2.0))
    with pytest.raises(ValueError, match="downwind must be distances"):
        Values(houses=2, downwind=(3.0, 2.0))
