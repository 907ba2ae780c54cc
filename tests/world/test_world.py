"""The world as a whole: order of a step, bookkeeping, endings, and the same evolution wherever it runs."""

from itertools import pairwise

import numpy as np
import pytest
import torch
from torch import Tensor

from tests.world.drawing import differing, draw, drawn
from warp_torchrl.world.air.gridded import Gridded
from warp_torchrl.world.air.hills import Hills
from warp_torchrl.world.air.terrain import Terrain
from warp_torchrl.world.air.wind import Calm, Paper, Uniform, Wandering
from warp_torchrl.world.arrays.batch import Batch
from warp_torchrl.world.arrays.random import Stream, uniform
from warp_torchrl.world.backends import backend
from warp_torchrl.world.backends.tick import advance, in_wind
from warp_torchrl.world.ignition.ignition import Ignition
from warp_torchrl.world.law.fire import Fire
from warp_torchrl.world.law.hazard import HazardFire
from warp_torchrl.world.law.rate import RateFire
from warp_torchrl.world.state.cells import count_trees, is_burning, is_tree
from warp_torchrl.world.state.state import Cover, WorldState
from warp_torchrl.world.team.team import Team
from warp_torchrl.world.terrain.array import Array
from warp_torchrl.world.terrain.landscape import Perlin
from warp_torchrl.world.world import _CELLS_AT_ONCE, World

STAY, EXTINGUISH, CLEAR, EAST = 10, 8, 9, 2

COMPLETE_FIRE = Fire(growth=True, beta=0.65, p_regrow=0.01)
SMALL_TEAM = Team(n_agents=3, roles=("ugv", "uav"))
MAP = np.random.default_rng(0).integers(1, 5, (20, 30))  # land covers
WORLDS = {
    "control": World(landscape=Perlin(size=(16, 21)), wind=Calm(), team=SMALL_TEAM, steps_per_tick=2),
    "relief and the paper's wind": World(
        landscape=Perlin(size=(16, 21), relief=100.0),
        wind=Paper(scale=0.5, rotate=True),
        fire=COMPLETE_FIRE,
        team=Team(n_agents=3, roles=("ugv", "uav"), tank=3, extinguish_p=0.7, start="anywhere"),
        ignition=Ignition(count=2, head_start=3),
        steps_per_tick=2,
    ),
    "a random direction, five stages": World(
        landscape=Perlin(size=(12, 30), relief=40.0, independent_elevation=True),
        wind=Uniform(speed=6.0),
        fire=Fire(burning_stages=5, diagonal="unit", wet_ticks=3),
        team=Team(n_agents=2, allow_stay=False),
        steps_per_tick=3,
        horizon=50,
    ),
    "law hazard, the ellipse, a wind that wanders, drawn terrain": World(
        landscape=Perlin(size=(14, 17), scale=(6.0, 20.0), octaves=(1, 6), persistence=(0.3, 0.6), relief=(0.0, 90.0)),
        wind=Wandering(speed=7.0),
        fire=HazardFire(kernel="ellipse", p_regrow=0.02, refinement=3),
        team=SMALL_TEAM,
        steps_per_tick=1,
    ),
    "windows of a map and its winds in time, four neighbours": World(
        landscape=Array(cover=MAP, elevation=MAP * 9.0, size=(12, 15)),
        wind=Gridded(u=np.stack([MAP - 2.0, 2.0 - MAP]), v=np.stack([MAP, MAP / 2.0]), ticks_per_field=4),
        fire=Fire(neighbours=4, growth=True),
        team=SMALL_TEAM,
        steps_per_tick=2,
    ),
    "a drawn wind over hills, in metres and minutes": World(
        landscape=Perlin(size=(16, 12), relief=60.0),
        wind=Terrain(speed=(2.0, 8.0), hills=Hills(layers=5, columns=48, iterations=4)),
        fire=RateFire(minutes_per_tick=10.0),
        team=SMALL_TEAM,
        steps_per_tick=2,
    ),
}


@pytest.fixture(params=WORLDS)
def world(request: pytest.FixtureRequest) -> World:
    return WORLDS[request.param]


def start(world: World, seeds: range, episode: int = 0) -> WorldState:
    seed = torch.arange(seeds.start, seeds.stop)
    return world.reset(seed, torch.full_like(seed, episode))


def chosen(world: World, state: WorldState) -> Tensor:
    """Choose at random, as a function of the world's key and step."""
    u = uniform(state.key, state.step, Stream.POLICY, (world.team.n_agents,))
    return (u * world.team.n_actions).to(torch.int64)


def stay(world: World, state: WorldState) -> Tensor:
    return torch.full((state.key.shape[0], world.team.n_agents), STAY)


def run(world: World, state: WorldState, steps: int) -> WorldState:
    for _ in range(steps):
        state = world.step(state, chosen(world, state)).after
    return state


# The same world everywhere.


def test_ticking_the_worlds_that_are_due_alone_changes_nothing(world: World) -> None:
    state = run(world, start(world, range(8)), 5)
    for due in ([True] * 8, [False] * 8, [index % 3 == 1 for index in range(8)]):
        mask = torch.tensor(due)
        some = backend.advance_rows(state, mask, lambda rows, ticks: advance(rows, world.fire, world.air, ticks))
        assert not differing(some, advance(state, world.fire, world.air, mask))


def test_a_world_alone_is_the_world_in_batches_of_7_and_24(world: World) -> None:
    # Bit for bit, every tensor, 60 steps: seed 13 is world 3 of seven and world 13 of twenty-four.
    many, few, alone = (start(world, seeds) for seeds in (range(24), range(10, 17), range(13, 14)))
    for step in range(61):
        assert differing(few[3:4], alone) == [], step
        assert differing(many[10:17], few) == [], step
        many, few, alone = (world.step(state, chosen(world, state)).after for state in (many, few, alone))
    assert many.done.any() or world.horizon > 60


@pytest.mark.skipif(not torch.cuda.is_available(), reason="needs a CUDA device")
def test_cuda_burns_as_the_cpu_does_for_100_ticks(world: World) -> None:
    ours = start(world, range(4))
    theirs, everywhere = ours.to("cuda"), torch.ones(4, dtype=torch.bool)
    for tick in range(100):
        ours = advance(ours, world.fire, world.air, everywhere)
        theirs = advance(theirs, world.fire, world.air, everywhere.cuda())
        for name in ("cells", "age", "burned", "wet", "tick"):
            assert torch.equal(getattr(ours, name), getattr(theirs, name).cpu()), (tick, name)


def test_many_worlds_start_in_parts(world: World, monkeypatch: pytest.MonkeyPatch) -> None:
    whole = start(world, range(7))
    rows, columns = world.size
    monkeypatch.setitem(_CELLS_AT_ONCE, "cpu", 3 * rows * columns)  # parts of 3, 3 and 1
    assert differing(start(world, range(7)), whole) == []


def test_a_reset_repeats(world: World) -> None:
    assert differing(start(world, range(8)), start(world, range(8))) == []
    assert differing(start(world, range(8), episode=5), start(world, range(8), episode=5)) == []


def test_seeds_and_episodes_are_different_worlds(world: World) -> None:
    state, later = start(world, range(8)), start(world, range(8), episode=1)
    for one in range(8):
        assert not torch.equal(state.landscape.age[one], later.landscape.age[one])
        for other in range(one):
            assert not torch.equal(state.landscape.age[one], state.landscape.age[other])


def test_a_run_repeats_and_leaves_the_state_before_alone(world: World) -> None:
    state = run(world, start(world, range(8)), 20)
    before = {name: plane.clone() for name, plane in state.leaves().items()}
    transition = world.step(state, chosen(world, state))
    assert differing(transition.after, world.step(state, chosen(world, state)).after) == []
    assert transition.before is state or differing(transition.before, state) == []
    assert all(torch.equal(plane, before[name]) for name, plane in state.leaves().items())


def test_teams_that_stay_away_meet_the_same_fire() -> None:
    # Common random numbers: the draws know nothing of the agents.
    one = World(landscape=Perlin(size=20), fire=COMPLETE_FIRE, team=Team(n_agents=1), steps_per_tick=1)
    five = World(
        landscape=Perlin(size=20), fire=COMPLETE_FIRE, team=Team(n_agents=5, start="anywhere"), steps_per_tick=1
    )
    alone, together = start(one, range(6)), start(five, range(6))
    for _ in range(40):
        alone, together = one.step(alone, stay(one, alone)).after, five.step(together, stay(five, together)).after
        assert torch.equal(alone.cells, together.cells)


# Reset.


@pytest.mark.parametrize("size", [8, 16, (12, 40)])
def test_a_fire_lives_after_every_reset(size: int | tuple[int, int]) -> None:
    state = start(World(landscape=Perlin(size=size), team=Team(n_agents=1)), range(512))
    assert (is_burning(state.cells).sum((1, 2)) > 0).all()
    assert torch.equal(count_trees(state).alight, is_burning(state.cells).sum((1, 2), dtype=torch.int32))
    assert not state.done.any()


@pytest.mark.parametrize("head_start, size", [(0, 32), (1, 32), (4, 32), (5, 32), (20, 16)])
def test_a_fire_lives_after_every_head_start(head_start: int, size: int) -> None:
    # A small fire may burn out within its head start: the episode has to start before.
    world = World(landscape=Perlin(size=size), team=Team(n_agents=1), ignition=Ignition(head_start=head_start))
    state = start(world, range(512))
    assert (is_burning(state.cells).sum((1, 2)) > 0).all()


def test_ignition_lights_old_enough_trees_only() -> None:
    state = start(World(ignition=Ignition(count=3, head_start=0)), range(256))
    lit = is_burning(state.cells)
    assert (state.cells[lit] == 11).all()
    assert (state.landscape.age[lit] >= 2).all()
    assert torch.equal(state.age, torch.where(lit, state.landscape.age, 0))
    assert torch.equal(state.cells[~lit], state.landscape.age[~lit])


def test_the_head_start_is_ticks_of_the_fire() -> None:
    state = start(World(ignition=Ignition(head_start=3)), range(16))
    assert (state.tick == 3).all()
    assert (state.step == 0).all()
    assert (state.cells.amax((1, 2)) == 14).all()


def test_trees_are_counted_before_ignition() -> None:
    state = start(World(ignition=Ignition(head_start=2)), range(16))
    assert torch.equal(count_trees(state).initial, (state.landscape.age > 0).sum((1, 2), dtype=torch.int32))
    assert torch.equal(state.initial, state.landscape.age > 0)


def test_a_map_without_fuel_is_an_error() -> None:
    world = World(landscape=Array(cover=[[3] * 8] * 8, age=[[1] * 8] * 8))
    with pytest.raises(ValueError, match="landscape"):
        start(world, range(2))


def test_a_team_without_room_on_dry_ground_is_an_error() -> None:
    # Two bulldozers, and one cell of an 8 x 8 map that is not lake (and burns): neither may stand in the water.
    cover = [[0] * 8 for _ in range(8)]
    cover[4][4] = Cover.FOREST
    with pytest.raises(ValueError, match="n_agents"):
        start(World(landscape=Array(cover=cover, age=[[9] * 8] * 8), team=Team(n_agents=2)), range(1))


def test_nobody_starts_in_a_lake_or_in_fire() -> None:
    for where in ("corner", "anywhere"):
        world = World(landscape=Perlin(size=12), team=Team(n_agents=8, start=where), ignition=Ignition(head_start=0))
        state = start(world, range(128))
        row, column = state.vehicles.position.unbind(-1)
        worlds = torch.arange(128)[:, None]
        assert not is_burning(state.cells[worlds, row, column]).any()
        assert (state.landscape.cover[worlds, row, column] != Cover.LAKE).all()


# The order of a step.


def drawn_world(**fields: object) -> World:
    """Return rules for drawn states; their landscape is never asked."""
    return World(landscape=Perlin(size=4), wind=Calm(), **{"team": Team(n_agents=1), **fields})


def test_the_fire_ticks_on_every_nth_step_of_each_world_s_own_episode() -> None:
    # Steps 0, 1, 2 and 8 of four worlds, 3 steps a tick: ticks fall on the steps that end at 3, 6, 9...
    world = drawn_world(steps_per_tick=3)
    state = draw("TaT TTT", worlds=4)
    state = state.replace(step=torch.tensor([0, 1, 2, 8], dtype=torch.int32))
    ticked = []
    for _ in range(4):
        state = world.step(state, stay(world, state)).after
        ticked.append(state.tick.tolist())
    assert ticked == [[0, 0, 1, 1], [0, 1, 1, 1], [1, 1, 1, 1], [1, 1, 2, 2]]
    assert state.step.tolist() == [4, 5, 6, 12]


def test_an_act_comes_before_the_tick_of_its_step() -> None:
    # The only fire is put out before it can pass to its neighbour, which grassland would make certain.
    world = drawn_world(steps_per_tick=1)
    state = draw("..a T.. T.. ...", at=[(0, 1)])
    after = world.step(state, torch.tensor([[EXTINGUISH]])).after
    assert drawn(after) == "..T T.. T.. ..."
    assert after.wet[0, 0, 2] == 9
    assert after.terminated.tolist() == [True]


def test_a_fire_that_no_longer_burns_has_ended_its_world() -> None:
    world = drawn_world(steps_per_tick=1)
    state = draw("e.. ...")
    transition = world.step(state, stay(world, state))
    assert drawn(transition.after) == "... ..."
    assert transition.after.terminated.tolist() == [True]
    assert transition.after.truncated.tolist() == [False]
    assert transition.counts_after.burned.tolist() == [1]


def test_embers_keep_a_world_going() -> None:
    world = drawn_world(steps_per_tick=2)
    state = draw("e.. ...")
    state = world.step(state, stay(world, state)).after
    assert state.done.tolist() == [False]
    assert world.step(state, stay(world, state)).after.terminated.tolist() == [True]


def test_with_lightning_a_world_ends_only_at_the_horizon() -> None:
    world = drawn_world(steps_per_tick=1, horizon=9, fire=Fire(beta=1e-9))
    state = draw("e.. ...")
    for step in range(1, 10):
        state = world.step(state, stay(world, state)).after
        assert (state.terminated.item(), state.truncated.item()) == (False, step == 9)


def test_a_world_is_truncated_at_its_horizon() -> None:
    world = drawn_world(steps_per_tick=5, horizon=3)
    state = draw("TaT", worlds=2)
    state = state.replace(step=torch.tensor([0, 1], dtype=torch.int32))
    flags = []
    for _ in range(3):
        state = world.step(state, stay(world, state)).after
        flags.append(state.truncated.tolist())
    assert flags == [[False, False], [False, True], [True, True]]
    assert state.step.tolist() == [3, 3]
    assert not state.terminated.any()


def test_a_fire_that_dies_on_the_last_step_is_both() -> None:
    world = drawn_world(steps_per_tick=1, horizon=1)
    after = world.step(draw("e.."), torch.tensor([[STAY]])).after
    assert (after.terminated.item(), after.truncated.item()) == (True, True)


def test_the_burning_area_adds_up_shares_of_the_first_forest() -> None:
    # Four trees, one on fire, then two (the neighbour for certain): 1/4 before the tick, 2/4 after it.
    world = drawn_world(steps_per_tick=2)
    state = draw("aT.TT")
    state = world.step(state, stay(world, state)).after
    assert state.burning_area.item() == pytest.approx(0.25)
    state = world.step(state, stay(world, state)).after
    assert drawn(state) == "ba.TT"
    assert state.burning_area.item() == pytest.approx(0.75)


# A finished world.


@pytest.mark.parametrize(
    "world",
    [
        World(
            landscape=Perlin(size=12, levels=(0.2, 0.8, 0.9)),
            wind=Calm(),
            team=Team(n_agents=3, roles=("ugv", "uav"), tank=2),
            steps_per_tick=1,
            horizon=20,
        ),
        World(landscape=Perlin(size=12), fire=COMPLETE_FIRE, team=Team(n_agents=2), steps_per_tick=2, horizon=25),
    ],
    ids=["burnt out or truncated", "truncated with lightning"],
)
def test_a_finished_world_stays_as_it_is(world: World) -> None:
    state = start(world, range(48))
    for _ in range(45):
        transition = world.step(state, chosen(world, state))
        frozen, result = state.done, transition.result
        assert differing(state[frozen], transition.after[frozen]) == []
        assert not (result.moved | result.extinguished | result.cleared | result.redundant)[frozen].any()
        assert (transition.after.step == state.step + ~frozen).all()
        state = transition.after
    assert state.done.all()
    assert state.truncated.any()
    assert state.terminated.any() == (world.fire.beta == 0.0)


def test_the_action_in_a_finished_world_does_not_matter() -> None:
    world = WORLDS["control"]
    state = start(world, range(4))
    state = state.replace(terminated=torch.ones(4, dtype=torch.bool))
    for action in range(11):
        after = world.step(state, torch.full((4, 3), action)).after
        assert differing(state, after) == []


# Bookkeeping.

LEDGERS = {
    "growth, lightning, regrowth": World(
        landscape=Perlin(size=(14, 18)),
        fire=Fire(growth=True, beta=5.0, p_regrow=0.05),
        team=Team(n_agents=6, roles=("ugv", "uav")),
        steps_per_tick=2,
        horizon=1000,
    ),
    "the fire alone": World(
        landscape=Perlin(size=(14, 18)), wind=Calm(), team=Team(n_agents=6), steps_per_tick=4, horizon=1000
    ),
}


@pytest.fixture(scope="module", params=LEDGERS)
def ledger(request: pytest.FixtureRequest) -> list[WorldState]:
    """Return 12 worlds of a kind before and after each of 100 steps."""
    world = LEDGERS[request.param]
    states = [start(world, range(12))]
    for _ in range(100):
        states.append(world.step(states[-1], chosen(world, states[-1])).after)
    return states


def test_every_first_tree_is_accounted_for_at_every_step(ledger: list[WorldState]) -> None:
    # The ledger follows each cell by what its code did; T_p + T_e + T_c + T_b + burning = N0.
    first = ledger[0].landscape.age > 0
    ash = put_out = cleared = torch.zeros_like(first)
    for state, after in pairwise(ledger):
        was, now = state.cells, after.cells
        ash = ash | (is_burning(was) & (now == 0))
        put_out = put_out | (is_burning(was) & is_tree(now))
        cleared = cleared | (is_tree(was) & (now == 0))
        fates = {
            "burned": first & ash,
            "cleared": first & ~ash & cleared,
            "burning": first & ~ash & is_burning(now),
            "extinguished": first & ~ash & is_tree(now) & put_out,
            "preserved": first & ~ash & is_tree(now) & ~put_out,
        }
        counts = count_trees(after)
        for name, cells in fates.items():
            assert torch.equal(getattr(counts, name), cells.sum((1, 2), dtype=torch.int32)), name
        assert torch.equal(sum(getattr(counts, name) for name in fates), first.sum((1, 2), dtype=torch.int32))
        assert torch.equal(counts.initial, first.sum((1, 2), dtype=torch.int32))
        assert torch.equal(counts.alight, is_burning(now).sum((1, 2), dtype=torch.int32))
    assert ash.any()
    assert put_out.any()
    assert cleared.any()


def test_burned_never_unburns_and_a_firebreak_stays(ledger: list[WorldState]) -> None:
    for state, after in pairwise(ledger):
        assert not (state.burned & ~after.burned).any()
        assert not (state.firebreak & ~after.firebreak).any()
        assert not (state.extinguished & ~after.extinguished).any()
        assert (count_trees(after).burned >= count_trees(state).burned).all()
        assert (after.cells[after.firebreak] == 0).all()
        assert torch.equal(after.age > 0, is_burning(after.cells))
        assert torch.equal(after.initial, state.initial)


def test_cells_change_only_as_the_automaton_allows(ledger: list[WorldState]) -> None:
    # From each code: a tree grows by one, catches fire or is cleared; fire goes a stage on, or out to its old age
    # (and a tick older at most); the ember turns to ash; ash grows a seedling.
    for state, after in pairwise(ledger):
        was, now, old_age = state.cells, after.cells, state.age
        tree, burning = is_tree(was), is_burning(was)
        as_tree = (now == was) | (now == was + 1) | (now == 11) | (now == 0)
        as_fire = (now == was) | (now == was + 1) | (now == old_age) | (now == old_age + 1)
        as_ember = (now == 15) | (now == 0)
        as_empty = (now == 0) | (now == 1)
        allowed = torch.where(tree, as_tree, torch.where(was == 15, as_ember, torch.where(burning, as_fire, as_empty)))
        assert allowed.all()


def test_the_counts_of_trees_by_hand() -> None:
    # Ten trees: one put out, one on fire, one cleared, two burned (one of them regrown as a seedling), five untouched;
    # a seedling on ground that was bare counts nowhere.
    state = draw("TTTTa ...#T 111TT", age_on_fire=3)
    initial = torch.ones(1, 3, 5, dtype=torch.bool)
    initial[0, 1, :2] = initial[0, 2, 0] = initial[0, 2, 1] = False
    initial[0, 1, 2] = True
    extinguished = torch.zeros_like(initial)
    extinguished[0, 0, 0] = True
    burned = torch.zeros_like(initial)
    burned[0, 1, 2] = burned[0, 2, 2] = True
    found = count_trees(state.replace(initial=initial, extinguished=extinguished, burned=burned))
    counts = {name: getattr(found, name).item() for name in ("initial", "preserved", "extinguished", "cleared")}
    # Row 0: 1 put out, 3 untouched, 1 on fire. Row 1: 1 ash, 1 cleared, 1 untouched. Row 2: 1 regrown, 2 untouched.
    assert counts == {"initial": 11, "preserved": 6, "extinguished": 1, "cleared": 1}
    assert (found.burned.item(), found.burning.item(), found.alight.item()) == (2, 1, 1)
    assert found.saved().item() == pytest.approx(7 / 11)


def test_ground_and_air_are_replaced_whole() -> None:
    state = start(WORLDS["control"], range(2))
    for derived in ("wind", "alpha", "landscape", "cover"):
        with pytest.raises(TypeError, match=derived):
            state.replace(**{derived: getattr(state, derived)})
    gale = in_wind(state, WORLDS["control"].fire, torch.full((2, 2, 1, 1), 30.0))
    made, other = state.air.terms.leaves(), gale.air.terms.leaves()
    assert set(made) == {"gain", "table"} and not any(torch.equal(made[name], other[name]) for name in made)


def test_what_follows_from_ground_and_air_is_made_again_from_what_changes(world: World) -> None:
    state = start(world, range(3))
    emptied = state.replace(
        ground=state.ground.replace(alpha=torch.zeros_like(state.alpha), terms=Batch()),
        air=state.air.replace(terms=Batch()),
    )
    assert differing(world.restored(emptied), state) == []
