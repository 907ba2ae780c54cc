"""Agents that face the fire: a map that is turned or mirrored looks the same to them, and they do the same there."""

import itertools

import pytest
import torch

from tests.conftest import small_world
from tests.test_observation import drawn
from warp_torchrl.env import WildfireEnv
from warp_torchrl.evaluation import play
from warp_torchrl.heuristics import HEURISTICS
from warp_torchrl.observation import CHANNELS, Frame, Local, Paper, Surroundings, facing, window
from warp_torchrl.world.landscape import Perlin
from warp_torchrl.world.state import Action
from warp_torchrl.world.team import Team
from warp_torchrl.world.wind import Uniform

TURNS = list(itertools.product((1, -1), (1, -1), (False, True)))
"""Whether rows, then columns, are mirrored, and whether they change places after that."""
PRESETS = (Local(facing="fire", identity=True), Surroundings(facing="fire", centred=True))
SIZE = 16


def fighting(observation, n_worlds=6, steps=12):
    """Worlds of a windy, flat map that burn, with a team among the trees."""
    team = Team(n_agents=3, roles=("ugv", "ugv", "uav"), start="anywhere")
    world = small_world(
        landscape=Perlin(size=SIZE), wind=Uniform(speed=7.0, direction=35.0), team=team, horizon=60, steps_per_tick=3
    )
    env = WildfireEnv(world, n_worlds=n_worlds, observation=observation, seed=3)
    now, rule = env.reset(), HEURISTICS["local"](env)
    for _ in range(steps):
        now = env.step(rule(now))["next"]
    return env


def turned_map(plane, rows, columns, swapped):
    """Return planes [..., H, W] as the map's other side shows them."""
    plane = plane.flip(-2) if rows < 0 else plane
    plane = plane.flip(-1) if columns < 0 else plane
    return plane.transpose(-1, -2).contiguous() if swapped else plane.contiguous()


def turned_vector(vector, rows, columns, swapped):
    vector = vector * torch.tensor([rows, columns])
    return vector.flip(-1) if swapped else vector


def turned_actions(action, turn):
    """Return actions on the map, int64 [...], as they are on the turned one."""
    frame = Frame(sign=torch.tensor(turn[:2]).expand(*action.shape, 2), swapped=torch.full(action.shape, turn[2]))
    return torch.where(action < 0, action, frame.steered(action.clamp(min=0)))


def turned_world(state, turn):
    """Return whole worlds turned."""
    leaves = {
        name: turned_map(value, *turn)
        for name, value in state.to_dict().items()
        if isinstance(value, torch.Tensor) and value.shape[1:] == (SIZE, SIZE)
    }
    middle = (SIZE - 1) / 2
    old = state.vehicles
    place, base = ((turned_vector(each - middle, *turn) + middle).to(torch.int64) for each in (old.position, old.base))
    vehicles = old.replace(position=place, base=base, last_action=turned_actions(old.last_action, turn))
    east, north = state.wind[:, 0], state.wind[:, 1]
    south_east = turned_vector(torch.stack((-north, east), dim=-1), *turn)
    wind = torch.stack((south_east[..., 1], -south_east[..., 0]), dim=1)
    cover = state.landscape.replace(cover=turned_map(state.cover, *turn), age=turned_map(state.landscape.age, *turn))
    return state.replace(vehicles=vehicles, wind=wind, landscape=cover, **leaves)


@pytest.mark.parametrize("preset", PRESETS, ids=lambda each: type(each).__name__)
@pytest.mark.parametrize("turn", TURNS, ids=str)
def test_a_turned_world_looks_the_same_and_the_same_acts_change_it_alike(preset, turn):
    env, other = fighting(preset), fighting(preset)
    before = env.world_state.clone()
    here, there = env.set_state(before), other.set_state(turned_world(before, turn))
    sees = pulled(preset, before)
    assert sees.sum() >= 10
    for entry, seen in here["agents", "observation"].items():
        torch.testing.assert_close(there["agents", "observation", entry][sees], seen[sees], atol=1e-6, rtol=0.0)
    assert torch.equal(here["agents", "action_mask"][sees], there["agents", "action_mask"][sees])
    for first in (0, 5):  # every agent says something else
        action = (torch.arange(18).view(6, 3) + first) % len(Action)
        env.set_state(before)
        other.set_state(turned_world(before, turn))
        for each in (env, other):
            each.step(each.set_state(each.world_state).set(("agents", "action"), action))
        ours, theirs = turned_world(env.world_state, turn), other.world_state
        assert torch.equal(ours.vehicles.position[sees], theirs.vehicles.position[sees]), first
        assert torch.equal(ours.vehicles.last_action[sees], theirs.vehicles.last_action[sees]), first


def pulled(preset, state):
    """Return which agents see fire more on one side than on the other, bool [B, A]: their frames are not arbitrary."""
    mirrored = turned_world(state, (-1, -1, False))
    swapped = turned_world(state, (1, 1, True))
    here, there, across = (preset.frame(each) for each in (state, mirrored, swapped))
    return (here.sign == -there.sign).all(-1) & (here.swapped != across.swapped)


def test_worlds_really_are_turned():
    """The check on the check: agents who do not face the fire see another map."""
    env = fighting(Local())
    before = env.world_state.clone()
    seen = [env.set_state(turned_world(before, turn))["agents", "observation", "view"] for turn in TURNS]
    assert not any(torch.equal(one, another) for one, another in itertools.combinations(seen, 2))


@pytest.mark.parametrize("preset", PRESETS, ids=lambda each: type(each).__name__)
def test_the_fire_lies_between_east_and_south_east(preset):
    places = [[0, 0], [0, 9], [15, 15], [2, 15], [9, 11], [12, 2], [7, 4]]
    cells = torch.full((16, 16), 5)
    cells[8, 8] = 11
    state, world = drawn(cells.tolist(), places)
    seen = preset(state, world, preset.frame(state))
    shown = seen["view"][0, :, CHANNELS.index("fire_stage")] if preset is PRESETS[0] else seen["picture"][0, :, 0]
    found = 0
    for plane in shown:
        for row, column in (plane.nonzero() - len(plane) // 2).tolist():
            assert 0 <= row <= column
            found += 1
    assert found == (2 if preset is PRESETS[0] else len(places)), "what is within five cells, or all"


def test_the_frame_by_hand():
    # From (2, 6), what burns at (0, 1) is two rows up and five columns to the left: mirrored both, it is (2, 5) away.
    away = torch.tensor([[[[-2.0, -5.0]], [[-5.0, 2.0]], [[0.0, 0.0]]]])
    frame = facing(torch.ones(1, 1, 1), away)
    assert frame.sign.tolist() == [[[-1, -1], [-1, 1], [1, 1]]]
    assert frame.swapped.tolist() == [[False, True, False]]
    assert frame.turned(away[:, :, 0]).tolist() == [[[2.0, 5.0], [2.0, 5.0], [0.0, 0.0]]]
    east = torch.full((1, 3), int(Action.EAST))
    assert frame.on_map(east).tolist() == [[Action.WEST, Action.NORTH, Action.EAST]]
    assert torch.equal(frame.steered(frame.on_map(east)), east)
    assert frame.on_map(torch.full((1, 3), int(Action.CLEAR))).tolist() == [[Action.CLEAR] * 3]


def test_near_fires_count_for_more():
    # A fire 1 cell north pulls with 1 / (1 + 2)^3 = 0.037, one 4 cells south with 4 / (4 + 2)^3 = 0.019, three 0.056.
    away = torch.tensor([[[[-1.0, 0.0], [4.0, 0.0]]]])
    assert facing(torch.ones(1, 1, 2), away).sign[0, 0, 0] == -1
    assert facing(torch.tensor([[[1.0, 3.0]]]), away).sign[0, 0, 0] == 1, "three of them are more"


def test_entries_by_action_are_reordered_and_back():
    frame = facing(torch.ones(4, 1, 1), torch.randn(4, 3, 1, 2))
    for n_actions in (10, 11):
        entries = torch.randn(4, 3, n_actions)
        said = frame.reordered(entries)
        assert torch.equal(frame.reordered_back(said), entries)
        for action in range(n_actions):
            meant = frame.on_map(torch.full((4, 3), action))
            assert torch.equal(said[..., action], entries.gather(-1, meant[..., None])[..., 0])


def test_a_window_in_a_frame_by_hand():
    plane = torch.arange(1, 10).view(1, 3, 3)
    place = torch.tensor([[[0, 1]]])
    mirrored = Frame(sign=torch.tensor([[[-1, 1]]]), swapped=torch.tensor([[False]]))
    turned = Frame(sign=torch.tensor([[[-1, 1]]]), swapped=torch.tensor([[True]]))
    assert window(place, (3, 3), 1).of(plane)[0, 0].tolist() == [[0, 0, 0], [1, 2, 3], [4, 5, 6]]
    assert window(place, (3, 3), 1, mirrored).of(plane)[0, 0].tolist() == [[4, 5, 6], [1, 2, 3], [0, 0, 0]]
    assert window(place, (3, 3), 1, turned).of(plane)[0, 0].tolist() == [[4, 1, 0], [5, 2, 0], [6, 3, 0]]


@pytest.mark.parametrize("name", HEURISTICS)
def test_heuristics_do_the_same_whichever_way_the_agents_face(make_small_env, name):
    plain = make_small_env(4)
    framed = make_small_env(4, observation=PRESETS[1])
    ours, theirs = (play(env, HEURISTICS[name](env), 11) for env in (plain, framed))
    assert all((ours[metric] == theirs[metric]).all() for metric in ours)


def test_north_is_up_unless_asked(make_small_env):
    env = make_small_env(2)
    env.reset()
    state = env.world_state
    assert Local().frame(state) is Surroundings().frame(state) is Paper().frame(state) is None


def test_agents_that_face_the_fire_need_a_picture_from_where_they_are():
    with pytest.raises(ValueError, match="facing must be north where centred is false"):
        Surroundings(facing="fire")
