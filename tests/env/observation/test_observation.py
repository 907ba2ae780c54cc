"""What agents see, by hand."""

import pytest
import torch

from tests.conftest import small_world
from warp_torchrl.env import WildfireEnv
from warp_torchrl.env.observation import (
    DEFAULT,
    CriticState,
    Local,
    Paper,
    Surroundings,
    egocentric_view,
    picture,
    status_vector,
)
from warp_torchrl.env.observation.features import NOTHING_MORE
from warp_torchrl.world.air.wind import Uniform
from warp_torchrl.world.backends.tick import in_wind
from warp_torchrl.world.team.team import Team
from warp_torchrl.world.terrain.array import Array
from warp_torchrl.world.terrain.landscape import Perlin


def drawn(cells, positions, *, elevation=None, roles=("ugv",), wind=None, cover=3):
    """A world of given codes with agents at given places."""
    codes = torch.tensor(cells, dtype=torch.uint8)[None]
    land = Array(cover=torch.full(codes.shape[1:], cover), age=torch.full(codes.shape[1:], 5), elevation=elevation)
    team = Team(n_agents=len(positions), roles=roles, start="anywhere")
    world = small_world(landscape=land, team=team, wind=wind or Uniform(speed=10.0, direction=0.0))
    state = world.reset(torch.tensor([0]), torch.tensor([0]))
    place = torch.tensor(positions)[None]
    state = state.replace(cells=codes, vehicles=state.vehicles.replace(position=place))
    return state, world


def own(state, world):
    return status_vector(state, world, world.forecast(state))


def judged(state, world, choice=NOTHING_MORE):
    """What the critic sees of the first world, by the plane's name."""
    shown = CriticState(world, choice)
    return dict(zip(shown.names, shown(state, world.forecast(state))[0], strict=True))


def channel(view, name):
    return view[0, 0, DEFAULT.index(name)]


@pytest.mark.parametrize("observation", [Surroundings(near=2), Surroundings(centred=False, identity=False), Paper()])
def test_what_is_seen_stays_within_its_space_and_reaches_its_bounds(observation):
    steep = Perlin(size=12, relief=900.0)
    world = small_world(landscape=steep, team=Team(n_agents=6, roles=("ugv", "uav")), horizon=60)
    env = WildfireEnv(world, observation=observation, n_worlds=4)
    seen = env.rollout(60, break_when_any_done=False)["agents", "observation"]
    named = {"": seen} if isinstance(seen, torch.Tensor) else dict(seen.items())
    for name, space in observation.spaces(world).items():
        low, high = space.bounds()
        assert low.dtype == high.dtype == named[name].dtype and low.shape == high.shape == space.shape
        assert (named[name] >= low).all() and (named[name] <= high).all(), name
        if name == "view":
            highest = dict(zip(DEFAULT, named[name].amax((0, 1, 2, 4, 5)).tolist()))
            assert [highest[each] for each in ("off_map", "fire_stage", "ash")] == [255, 255, 255]
            assert highest["age"] == 250 and highest["relative_elevation"] == 255


def test_the_view_shows_fire_age_and_the_border():
    cells = [[5, 5, 5, 5], [5, 11, 13, 5], [5, 5, 0, 5], [5, 5, 5, 10]]
    state, world = drawn(cells, [[1, 0]])
    view = egocentric_view(state, world, world.forecast(state), 1, DEFAULT)
    assert channel(view, "off_map").tolist() == [[255, 0, 0], [255, 0, 0], [255, 0, 0]]
    assert channel(view, "fire_stage").tolist() == [[0, 0, 0], [0, 0, 51], [0, 0, 0]]  # stage 1 of 5
    assert channel(view, "age").tolist() == [[0, 125, 125], [0, 125, 0], [0, 125, 125]]  # age 5 of 10
    assert channel(view, "flammability").tolist() == [[0, 204, 204]] * 3  # 0.8 x 255


def test_the_view_shows_for_how_long_trees_are_wet():
    # 25 a tick, at most ten of them.
    state, world = drawn([[5] * 4] * 4, [[1, 1]])
    ticks = torch.tensor([[[0, 1, 4, 0], [9, 10, 11, 0], [80, 0, 0, 0], [0] * 4]], dtype=torch.uint8)
    state = state.replace(wet=ticks)
    wet = channel(egocentric_view(state, world, world.forecast(state), 1, DEFAULT), "wet")
    assert wet.tolist() == [[0, 25, 100], [225, 250, 250], [250, 0, 0]]


def test_the_threat_of_a_tree_is_its_chance_to_ignite_and_of_a_fire_what_it_will_ignite():
    # Calm air, one fire in the middle of forest: axial 0.8, diagonal 0.8 / sqrt 2 = 0.566; sum 4 x 0.8 + 4 x 0.566.
    cells = [[5, 5, 5, 5], [5, 11, 5, 5], [5, 5, 5, 5], [5, 5, 5, 5]]
    state, world = drawn(cells, [[1, 1]], wind=Uniform(speed=0.0))
    threat = channel(egocentric_view(state, world, world.forecast(state), 1, DEFAULT), "threat")
    assert threat[0].tolist() == [int(0.8 / 2**0.5 * 255), int(0.8 * 255), int(0.8 / 2**0.5 * 255)]
    assert threat[1, 1] == 255  # 5.46 / 4, at most 1


def test_agents_see_each_other_and_not_themselves():
    state, world = drawn([[5] * 6] * 6, [[2, 2], [2, 3], [3, 2]], roles=("ugv", "ugv", "uav"))
    view = egocentric_view(state, world, world.forecast(state), 1, DEFAULT)
    assert channel(view, "other_ugv").tolist() == [[0, 0, 0], [0, 0, 63], [0, 0, 0]]
    assert channel(view, "other_uav").tolist() == [[0, 0, 0], [0, 0, 0], [0, 63, 0]]


@pytest.mark.parametrize(("agents", "shown"), [(1, 0), (2, 63), (5, 252), (7, 252)])
def test_up_to_four_others_are_told_apart_on_a_cell_and_oneself_is_none(agents, shown):
    state, world = drawn([[5] * 6] * 6, [[2, 2]] * agents)
    view = egocentric_view(state, world, world.forecast(state), 1, DEFAULT)
    assert channel(view, "other_ugv").tolist() == [[0, 0, 0], [0, shown, 0], [0, 0, 0]]


def test_elevation_is_relative_to_the_agent():
    slope = torch.arange(5).mul(50.0).expand(5, 5)
    state, world = drawn([[5] * 5] * 5, [[2, 2]], elevation=slope)
    # 50 m up: 128 + 127 / 2 = 191.5; 50 m down 64.5; whole numbers below
    assert channel(egocentric_view(state, world, world.forecast(state), 1, DEFAULT), "relative_elevation")[
        1
    ].tolist() == [
        64,
        128,
        191,
    ]


def test_an_agent_knows_its_place_the_time_and_the_wind():
    state, world = drawn([[5] * 5] * 5, [[4, 0]])
    row, column, time_left, east, north, to_tick, tank, has_tank = own(state, world)[0, 0, :8].tolist()
    assert (row, column, time_left, to_tick) == (1.0, 0.0, 1.0, 1.0)
    assert (east, north) == pytest.approx((0.5, 0.0), abs=1e-6)  # 10 of 20 m/s
    assert (tank, has_tank) == (1.0, 0.0)


def test_an_agent_knows_the_wind_of_its_own_cell():
    # East grows by 1 m/s a column and north by 2 m/s a row; three agents, whose own parts are of 20 m/s.
    row, column = torch.meshgrid(torch.arange(5.0), torch.arange(6.0), indexing="ij")
    state, world = drawn([[5] * 6] * 5, [[4, 0], [1, 5], [2, 3]])
    state = in_wind(state, world.fire, torch.stack((column, 2.0 * row))[None])
    wind = own(state, world)[0, :, 3:5] * 20.0
    torch.testing.assert_close(wind, torch.tensor([[0.0, 8.0], [5.0, 2.0], [3.0, 4.0]]))


def test_the_last_action_is_remembered():
    state, world = drawn([[5] * 5] * 5, [[4, 0]])
    before = own(state, world)[0, 0, -11:]
    after = own(world.step(state, torch.tensor([[8]])).after, world)[0, 0, -11:]
    assert before.sum() == 0 and after.tolist() == [0] * 8 + [1, 0, 0]


def test_the_picture_pools_the_whole_map():
    cells = torch.full((16, 16), 5)
    cells[0, 0] = 12  # one burning cell of four in the first block
    state, world = drawn(cells.tolist(), [[8, 8], [0, 15]])
    seen = picture(state, world, world.forecast(state))
    assert seen[0, 0, 0, 0, 0] == pytest.approx(0.5) and seen[0, 0, 0].sum() == pytest.approx(0.5)  # sqrt(1 / 4)
    assert seen[0, 0, 1, 7, 7] == pytest.approx(0.8)
    assert seen[0, 0, 2].nonzero().tolist() == [[0, 7]] and seen[0, 1, 2].nonzero().tolist() == [[4, 4]]


def test_the_critic_sees_every_agent_and_the_clock():
    state, world = drawn([[5] * 16] * 16, [[8, 8], [0, 15], [3, 4]], roles=("ugv", "ugv", "uav"))
    seen = judged(state, world)
    assert seen["ugv"].nonzero().tolist() == [[0, 15], [8, 8]]
    assert seen["uav"].nonzero().tolist() == [[3, 4]]
    clock = seen["clock_and_wind"]
    assert (clock[:8] == 1).all(), "the time left, the steps to the tick"
    torch.testing.assert_close(clock[8:, :8], torch.full((8, 8), 0.5))  # 10 of 20 m/s to the east
    torch.testing.assert_close(clock[8:, 8:], torch.zeros(8, 8))


def test_the_critic_sees_where_fire_is_about_to_grow():
    # As the threat of a view: axial 0.8, diagonal 0.8 / sqrt 2; a fire will ignite 4 x 0.8 + 4 x 0.566, at most 4.
    cells = torch.full((16, 16), 5)
    cells[4, 6], cells[10, 10] = 11, 15
    state, world = drawn(cells.tolist(), [[0, 0]], wind=Uniform(speed=0.0))
    seen = judged(state, world)
    assert seen["fire"].nonzero().tolist() == [[4, 6], [10, 10]]
    assert seen["front"].nonzero().tolist() == [[4, 6]] and seen["front"][4, 6] == 1.0, "an ember spreads no more"
    assert seen["threat"][4, 7] == pytest.approx(0.8) and seen["threat"][5, 7] == pytest.approx(0.8 / 2**0.5)
    assert seen["threat"].count_nonzero() == 8 and seen["threat"][4, 6] == 0.0


def test_the_critic_sees_how_high_a_block_lies_over_the_mean_of_the_map():
    # Rows of 32 cells at 500, 504 ... 624 m, of mean 562: blocks of two rows at 502, 510 ... 622.
    slope = (500.0 + 4.0 * torch.arange(32.0))[:, None].expand(32, 32)
    state, world = drawn([[5] * 32] * 32, [[0, 0]], elevation=slope)
    shown = CriticState(world)
    seen = shown(state, world.forecast(state))[0, shown.names.index("elevation")]
    expected = (502.0 + 8.0 * torch.arange(16.0) - 562.0) / 100.0
    torch.testing.assert_close(seen, expected[:, None].expand(16, 16))


@pytest.mark.parametrize("size", [16, 32, 20])
def test_a_centred_picture_is_the_picture_seen_from_the_agent(size):
    cells = torch.full((size, size), 5)
    cells[1, size - 1], cells[size // 2, 3] = 11, 12
    places = [[0, 0], [size - 1, 2], [size // 2, size // 2], [size // 2, size // 2]]
    state, world = drawn(cells.tolist(), places)
    plain, centred = Surroundings(radius=1, centred=False), Surroundings(radius=1)
    assert centred.spaces(world)["picture"].shape == (3, 15, 15)
    flat, seen = (
        plain(state, world, world.forecast(state))["picture"][0],
        centred(state, world, world.forecast(state))["picture"][0],
    )
    assert seen.dtype == torch.uint8 and seen.shape == (4, 3, 15, 15)
    for agent, place in enumerate(places):
        row, column = (each * 8 // size for each in place)
        window_of_map = seen[agent, :, 7 - row : 15 - row, 7 - column : 15 - column].to(torch.float32)
        assert window_of_map.sum() == seen[agent].to(torch.float32).sum(), "nothing is beyond the map"
        torch.testing.assert_close(window_of_map[:2] / 255.0, flat[agent, :2], atol=1.0 / 255.0, rtol=0.0)
        torch.testing.assert_close(window_of_map[2] / 63.0, flat[agent, 2] * 4.0)


def test_the_paper_preset_is_three_channels_flattened():
    state, world = drawn([[5] * 4, [5, 11, 5, 5]] * 2, [[0, 0]])
    seen = Paper(radius=1)(state, world, world.forecast(state))[""][0, 0].view(3, 3, 3)
    space = Paper(radius=1).spaces(world)[""]
    assert (space.shape, space.low, space.high) == ((27,), 0.0, 1.0)
    forest = torch.tensor([[0, 0, 0], [0, 0.8, 0.8], [0, 0.8, 0.8]])  # (code 3 + 1) / 5, off the map 0
    assert torch.allclose(seen[0], forest, atol=0.01)
    assert seen[1, 1, 1] == pytest.approx(0.5, abs=0.01)  # age 5 of 10
    assert seen[2, 2, 2] == pytest.approx(0.2, abs=0.01)  # stage 1 of 5


@pytest.mark.parametrize("preset", [Surroundings(), Local(), Paper()], ids=lambda each: type(each).__name__)
def test_what_lies_out_of_view_is_not_in_view_or_self(preset):
    """Of strictly local presets, nothing changes when all beyond the radius does."""
    inside = torch.full((20, 20), 5)
    outside = inside.clone()
    outside[12:, 12:] = 12
    worlds = [drawn(cells.tolist(), [[2, 2]]) for cells in (inside, outside)]
    seen = [preset(state, world, world.forecast(state)) for state, world in worlds]
    for name in seen[0]:
        same = (seen[0][name] == seen[1][name]).all()
        assert same == (name != "picture")


@pytest.mark.parametrize("preset", [Surroundings, Local, Paper])
@pytest.mark.parametrize("radius", [0, 33])
def test_a_radius_out_of_range_is_refused(preset, radius):
    with pytest.raises(ValueError, match="radius must be in"):
        preset(radius=radius)


@pytest.mark.parametrize("preset", [Local, Surroundings])
def test_agents_know_their_place_in_the_team_where_asked(preset):
    state, world = drawn([[5] * 6] * 6, [[2, 2], [2, 2], [2, 2], [2, 2]])
    without, told = (preset(radius=1, identity=asked) for asked in (False, True))
    assert told.spaces(world)["status"].shape == (without.spaces(world)["status"].shape[0] + 4,)
    own = told(state, world, world.forecast(state))["status"]
    assert own.shape == (1, 4, *told.spaces(world)["status"].shape)
    assert torch.equal(own[..., :-4], without(state, world, world.forecast(state))["status"])
    half = 0.5**0.5  # places 1/8, 3/8, 5/8 and 7/8 of a turn
    by_hand = [[half, half, 0.0, 1.0], [-half, half, 0.0, -1.0], [-half, -half, 0.0, 1.0], [half, -half, 0.0, -1.0]]
    torch.testing.assert_close(own[0, :, -4:], torch.tensor(by_hand), atol=1e-6, rtol=0.0)
    assert torch.equal(own[0, 0, :-4], own[0, 1, :-4]), "nothing else tells them apart here"
