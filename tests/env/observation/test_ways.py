"""The ways to fire, to an agent's share of it and to what is worth seeing, by hand and by loops over cells."""

import math

import pytest
import torch

from tests.heuristics.drawing import scene
from tests.world.drawing import draw, knowing
from tests.world.mechanics.there import needs
from warp_torchrl.api.make import make_env
from warp_torchrl.env import WildfireEnv
from warp_torchrl.env.observation import Context, way_to_fire, way_to_search, way_to_share
from warp_torchrl.heuristics import HEURISTICS
from warp_torchrl.models import signature
from warp_torchrl.runs.config.construction import ConfigError
from warp_torchrl.world.air.wind import Calm
from warp_torchrl.world.state.cells import is_burning
from warp_torchrl.world.team.team import Team
from warp_torchrl.world.terrain.array import Array
from warp_torchrl.world.world import World

ROW = "TTTTTTTTTTT TTTTTTTTTTT aTTTTTTTTTa TTTTTTTTTTT TTTTTTTTTTT"


def told(way, env, state):
    """What each agent of each world is told."""
    return way(Context(state, env.world, env.world.forecast(state), env.observation.choice))


def near(moves):
    return math.exp(-moves / 8.0)


def test_the_nearest_fire_by_hand():
    env, state = scene(ROW, at=[(0, 2), (2, 8), (2, 5)])
    ways = told(way_to_fire, env, state)[0].tolist()
    assert ways[0] == pytest.approx([-1.0, -1.0, near(2)]), "two cells to the west, two to the south"
    assert ways[1] == pytest.approx([1.0, 0.0, near(2)])
    assert ways[2] == pytest.approx([0.0, 0.0, near(5)]), "of two as near neither is preferred"


def test_the_share_of_each_is_what_no_other_is_nearer_to():
    env, state = scene(ROW, at=[(2, 3), (2, 5)])
    ways = told(way_to_share, env, state)[0].tolist()
    assert ways[0] == pytest.approx([-1.0, 0.0, near(3)])
    assert ways[1] == pytest.approx([1.0, 0.0, near(5)]), "the nearest fire is as near, but the other's"


def test_the_first_of_those_that_are_as_near_has_the_fire_and_who_has_none_is_told_zeros():
    env, state = scene(ROW.replace("Ta", "TT"), at=[(2, 4), (2, 4)])
    ways = told(way_to_share, env, state)[0].tolist()
    assert ways[0] == pytest.approx([-1.0, 0.0, near(4)]) and ways[1] == [0.0, 0.0, 0.0]


def test_no_fire_is_told_as_zeros():
    env, state = scene(ROW, at=[(0, 0), (1, 2)])
    state = state.replace(cells=torch.where(is_burning(state.cells), 0, state.cells))
    assert not told(way_to_fire, env, state).any() and not told(way_to_share, env, state).any()


def test_scouts_take_no_share_of_those_that_extinguish():
    for role, east in (("scout", -1.0), ("ugv", 1.0)):
        env, state = scene(ROW, at=[(2, 2), (2, 5)], roles=(role, "ugv"))
        first, second = told(way_to_share, env, state)[0].tolist()
        assert first == pytest.approx([-1.0, 0.0, near(2)])
        assert second[0] == pytest.approx(0.0 if role == "scout" else east)


def by_loops(state, world):
    """The share of each agent of a world where all see all: the least moves less six times the risk."""
    risk, fire = (
        world.forecast(state).fire_risk()[0],
        is_burning(state.cells)[0] & (state.cells[0] <= world.fire.last_spreading),
    )
    places, best = state.vehicles.position[0].tolist(), {}
    front = [cell for cell in fire.nonzero().tolist() if risk[tuple(cell)] > 0.01] or fire.nonzero().tolist()
    for row, column in front:
        moves = [max(abs(row - down), abs(column - right)) for down, right in places]
        who = moves.index(min(moves))
        cost = min(moves) - 6.0 * risk[row, column].item()
        best.setdefault(who, []).append((cost, min(moves), row, column))
    ways = torch.zeros(len(places), 3)
    for who, cells in best.items():
        least = min(cells)[0]
        moves, rows, columns = zip(*(each[1:] for each in cells if each[0] == least), strict=True)
        mean, count, (down, right) = sum(moves) / len(moves), len(moves), places[who]
        gap = (sum(columns) / count - right, down - sum(rows) / count)
        ways[who] = torch.tensor([gap[0] / max(mean, 1.0), gap[1] / max(mean, 1.0), near(mean)])
    return ways


def test_in_worlds_that_burn_the_share_is_what_loops_over_cells_find():
    env = make_env("default", n_worlds=4, overrides=["observation=guided"])
    shown, zeros = env.reset(), 0
    for _ in range(30):
        state = env.world_state
        ways = torch.stack([by_loops(state[[world]], env.world) for world in range(4)])
        assert torch.allclose(told(way_to_share, env, state), ways, atol=1e-5)
        assert torch.allclose(shown["agents", "observation", "status"][..., -6:-3], ways, atol=1e-5)
        zeros += (ways == 0).all(-1).sum()
        shown = env.step_and_maybe_reset(env.rand_action(shown))[1]
    assert zeros, "some agent had no share"


def test_numbers_turn_with_the_map():
    env = make_env("default", n_worlds=1, overrides=["observation=guided"])
    parts = signature(env).observation["status"].symmetry.parts
    vectors = [name for part in parts if part.kind == "vector" for name in part.names]
    assert {"fire_east", "fire_north", "share_east", "share_north"} <= set(vectors)
    drawing = ["TTTTTTT", "TTTTTaT", "TTTTTTT", "TTTTTTT", "TaTTTTT", "TTTTTTT", "TTTTTTT"]
    turned = ["".join(row[column] for row in reversed(drawing)) for column in range(7)]
    before = told(way_to_share, *scene(" ".join(drawing), at=[(3, 3), (2, 6)]))[0]
    after = told(way_to_share, *scene(" ".join(turned), at=[(3, 3), (6, 4)]))[0]
    assert torch.allclose(after[:, 0], before[:, 1]) and torch.allclose(after[:, 1], -before[:, 0])
    assert torch.equal(after[:, 2], before[:, 2]) and (before[:, 2] > 0).all()


@needs("sensing", "radio")
@pytest.mark.parametrize("shares", [[], ["mechanics.radio.carries=map"]], ids=["silent", "maps"])
def test_where_sight_is_limited_only_what_agents_know_is_told(shares):
    """Agents that are silent have ways to the fires of their own records, others to those of the team's."""
    env = make_env("scouts", n_worlds=8, overrides=["observation=guided", *shares])
    shown, found = env.reset(), 0
    for _ in range(25):
        state = env.world_state
        assumed = env.world.assumed(state)
        views = len(assumed.key) // 8
        assert views == (1 if shares else state.vehicles.position.shape[1])
        knows = is_burning(assumed.cells).flatten(1).any(1).view(8, views)
        fire = told(way_to_fire, env, state)[..., 2] > 0
        assert torch.equal(fire, knows.expand_as(fire))
        found += int(knows.any() and not knows.all())
        shown = env.step_and_maybe_reset(env.rand_action(shown))[1]
    assert found


@needs("sensing", "radio")
def test_team_mates_whose_place_is_not_known_have_no_share():
    from warp_torchrl.world.mechanics.radio.radio import Radio
    from warp_torchrl.world.mechanics.sensing.sensing import Sight

    field, team = " ".join(["TTTTTTTTT"] * 9), Team(n_agents=2)
    land = Array(cover=[[3] * 9] * 9, age=[[10] * 9] * 9)
    parts = {"sensing": Sight(radius=1), "mechanics": (Radio(range=0.0),)}
    env = WildfireEnv(World(landscape=land, wind=Calm(), team=team, **parts), n_worlds=1, seed=0)
    for first, ways in ((0, [near(4), near(2)]), (5, [near(1), 0.0])):
        state = draw(field, team=team, at=[(4, first), (4, 6)]).replace(step=torch.tensor([300], dtype=torch.int32))
        records = torch.full((1, 2, 9, 9), 301 * 64 + 10, dtype=torch.int32)
        records[:, :, 4, 4] = 301 * 64 + 11
        assert told(way_to_share, env, knowing(state, records))[0, :, 2].tolist() == pytest.approx(ways)


@needs("sensing")
def test_the_way_to_search_is_that_of_heuristics_and_none_where_all_is_seen():
    env, state = scene(ROW, at=[(2, 3), (2, 5)])
    assert not told(way_to_search, env, state).any()
    env = make_env("search", n_worlds=16, overrides=["observation.ways=[search]"])
    shown, policy, agreed, moved = env.reset(), HEURISTICS["dispatch"](env), 0, 0
    for _ in range(8):
        way = shown["agents", "observation", "status"][..., -3:]
        shown = policy(shown)
        action = shown["agents", "action"]
        blind = told(way_to_fire, env, env.world_state)[..., 2] == 0
        right = torch.tensor([0, 1, 1, 1, 0, -1, -1, -1])[action.clamp(max=7)]
        looks = blind & (action < 8) & (way[..., 0].abs() > 0.3)
        agreed, moved = agreed + (right * way[..., 0] > 0)[looks].sum(), moved + looks.sum()
        shown = env.step(shown)["next"]
    assert moved > 20 and agreed > 0.8 * moved


@needs("belief")
def test_ways_are_chosen_by_name_and_stay_beside_further_features():
    def names(*overrides):
        return make_env("skirmish", n_worlds=1, overrides=[*overrides]).channel_names["status"]

    assert names("observation.ways=[share]")[-6:] == (
        *("water_east", "water_north", "water_distance"),
        *("share_east", "share_north", "share_near"),
    )
    assert names("observation.features=[hidden_fire]")[-1] == "search_near"
    for chosen, got in (("[fires]", "fires"), ("[fire,fire]", r"\['fire', 'fire'\]")):
        with pytest.raises(
            ConfigError, match=f"ways must be a list of different names of fire, .*, got {got}"
        ) as error:
            names(f"observation.ways={chosen}")
        assert "\n" not in str(error.value)
