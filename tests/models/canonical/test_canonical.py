"""Canonical inputs: a map that is turned or mirrored is read the same, and agents do the same there."""

import itertools
from dataclasses import replace
from functools import cache

import pytest
import torch
from tensordict import TensorDict
from torchrl.envs import CatFrames, TransformedEnv

from tests.conftest import small_world
from tests.env.observation.test_observation import drawn
from warp_torchrl.algorithms.ddpg import Ddpg
from warp_torchrl.algorithms.dqn import Dqn
from warp_torchrl.algorithms.ppo import Ppo
from warp_torchrl.algorithms.sac import Sac
from warp_torchrl.entries import Part, Planes, Target, Vector
from warp_torchrl.env import WildfireEnv
from warp_torchrl.env.observation import DEFAULT, CriticState, Local, Paper, Surroundings
from warp_torchrl.heuristics import HEURISTICS
from warp_torchrl.models import (
    ACTION,
    ACTION_MASK,
    ACTION_ONE_HOT,
    ACTION_VALUE,
    CHOSEN_ACTION_VALUE,
    LOGITS,
    OBSERVATION,
    ORIENTATION,
    STATE_ACTION_VALUE,
    VALUE,
    Cnn,
    Mlp,
    over_canonical,
    signature,
)
from warp_torchrl.models.canonical import (
    Canonicalise,
    Orientation,
    canonical_state,
    orientation_of,
    turned,
)
from warp_torchrl.models.fitting import fitted
from warp_torchrl.runs.policies.trained import TrainedPolicy
from warp_torchrl.world.air.wind import Uniform
from warp_torchrl.world.arrays.geometry import DIRECTIONS
from warp_torchrl.world.backends.tick import in_wind
from warp_torchrl.world.law.fire import Fire
from warp_torchrl.world.state.state import Action
from warp_torchrl.world.team.team import Team
from warp_torchrl.world.terrain.landscape import Perlin

TURNS = list(itertools.product((1, -1), (1, -1), (False, True)))
"""Whether rows, then columns, are mirrored, and whether they change places after that."""
GENERATORS = ((1, -1, False), (1, 1, True))
"""Two of them, of which all others are made."""
PRESETS = {
    "whole map": Surroundings(centred=False, identity=False),
    "centred": Surroundings(),
    "near": Surroundings(near=2),
    "local": Local(),
    "paper": Paper(),
}
SLOW = {"near": pytest.mark.slow}
SIZE = 16
STATE_SYMMETRY = CriticState(small_world()).symmetry
ACTIONS = tuple(action.name.lower() for action in Action)


def fighting(observation, n_worlds=6, steps=12, mechanics=()):
    """Worlds of a windy, flat map that burn, with a team among the trees."""
    team = Team(n_agents=3, roles=("ugv", "ugv", "uav"), start="anywhere")
    world = small_world(
        landscape=Perlin(size=SIZE),
        wind=Uniform(speed=7.0, direction=35.0),
        team=team,
        mechanics=mechanics,
        horizon=60,
        steps_per_tick=3,
    )
    env = WildfireEnv(world, n_worlds=n_worlds, observation=observation, seed=3)
    env.set_state(played(world, n_worlds, steps).clone())
    return env


@cache
def played(world, n_worlds, steps):
    """Return what a few steps of ``local`` make of worlds."""
    env = WildfireEnv(world, n_worlds=n_worlds, seed=3)
    now, rule = env.reset(), HEURISTICS["local"](env)
    for _ in range(steps):
        now = env.step(rule(now))["next"]
    return env.world_state


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
    offsets = torch.tensor([*DIRECTIONS])
    turned = [[*DIRECTIONS].index(tuple(each)) for each in turned_vector(offsets, *turn).tolist()]
    names = torch.tensor([*turned, *range(len(turned), len(Action))])
    return torch.where(action < 0, action, names[action.clamp(min=0)])


def turned_world(state, turn):
    """Return whole worlds turned."""
    leaves = {
        name: turned_map(value, *turn)
        for name, value in state.leaves().items()
        if "." not in name and value.shape[1:] == (SIZE, SIZE)
    }
    middle = (SIZE - 1) / 2
    old = state.vehicles
    place, base = ((turned_vector(each - middle, *turn) + middle).to(torch.int64) for each in (old.position, old.base))
    vehicles = old.replace(position=place, base=base, last_action=turned_actions(old.last_action, turn))
    east, north = state.wind[:, 0], state.wind[:, 1]
    south_east = turned_vector(torch.stack((-north, east), dim=-1), *turn)
    wind = torch.stack((south_east[..., 1], -south_east[..., 0]), dim=1)
    cover = state.landscape.replace(cover=turned_map(state.cover, *turn), age=turned_map(state.landscape.age, *turn))
    fire = Fire()
    return in_wind(state.replace(vehicles=vehicles, ground=fire.ground(cover, 30.0, state.key), **leaves), fire, wind)


def symmetries(preset):
    """Return what the entries of a preset declare."""
    return {name: space.symmetry for name, space in preset.spaces(small_world()).items()}


def seen(now):
    """Return the entries of an observation by name."""
    found = now["agents", "observation"]
    return {"": found} if isinstance(found, torch.Tensor) else dict(found.items())


def pulled(preset, state, n_worlds=6):
    """Return which agents see fire more on one side than on the other, bool [B, A]: their frames are not arbitrary."""
    env = fighting(preset, n_worlds, steps=0)
    here, across, mirrored = (
        orientation_of(seen(env.set_state(turned_world(state, turn))), symmetries(preset)).index
        for turn in ((1, 1, False), (1, 1, True), (-1, -1, False))
    )
    return (here % 2 != across % 2) & (here // 2 == 3 - mirrored // 2)


def in_both(preset, turn):
    """Return what is observed in worlds and in the same worlds turned, and whose frames are not arbitrary."""
    env = fighting(preset)
    state = env.world_state.clone()
    here = env.set_state(state).clone()
    there = env.set_state(turned_world(state, turn)).clone()
    sees = pulled(preset, state)
    assert sees.sum() >= 6
    return here, there, sees


@pytest.mark.parametrize("name", [pytest.param(name, marks=SLOW.get(name, ())) for name in PRESETS])
@pytest.mark.parametrize("turn", TURNS, ids=str)
def test_a_turned_world_looks_the_same(name, turn):
    here, there, sees = in_both(PRESETS[name], turn)
    before, after = seen(here), seen(there)
    declared = symmetries(PRESETS[name])
    orientations = [orientation_of(each, declared) for each in (before, after)]
    for entry in before:
        ours, theirs = (turned(each[entry], declared[entry], way) for each, way in zip((before, after), orientations))
        torch.testing.assert_close(theirs[sees], ours[sees], atol=1e-6, rtol=0.0)
    masks = [way.by_action(now["agents", "action_mask"], ACTIONS) for now, way in zip((here, there), orientations)]
    assert torch.equal(masks[0][sees], masks[1][sees])
    torch.testing.assert_close(
        canonical_state(there["state"], STATE_SYMMETRY),
        canonical_state(here["state"], STATE_SYMMETRY),
        atol=1e-5,
        rtol=0.0,
    )


@pytest.mark.parametrize(
    "model", [Mlp(), Mlp(sharing="none"), Mlp(sharing="role"), Cnn()], ids=["team", "none", "role", "cnn"]
)
def test_networks_say_the_same_of_a_turned_world(model):
    """Logits and values of acts turn with the map, and a state's value stays what it is, whatever the weights."""
    preset, turn = PRESETS["whole map"], (-1, 1, True)
    here, there, sees = in_both(preset, turn)
    shape = signature(fighting(preset, steps=0))
    for key, network in ((LOGITS, model.actor(shape)), (ACTION_VALUE, model.action_value(shape))):
        ours, theirs = network(here)[key], network(there)[key]
        expected = torch.empty_like(ours).index_copy_(2, turned_actions(torch.arange(11), turn), ours)
        torch.testing.assert_close(theirs[sees], expected[sees], atol=1e-5, rtol=0.0)
        assert not torch.allclose(theirs[sees], ours[sees], atol=1e-5), "another map, north up"
    for central in (False, True):
        critic = model.critic(shape, central)
        torch.testing.assert_close(critic(there)[VALUE][sees], critic(here)[VALUE][sees], atol=1e-4, rtol=0.0)
    action = torch.arange(18).view(6, 3) % 11
    for now, said in ((here, action), (there, turned_actions(action, turn))):
        now[ACTION_ONE_HOT] = torch.nn.functional.one_hot(said, 11).to(torch.float32)
    judge = model.action_critic(shape, central=False)
    ours, theirs = (judge(now)[STATE_ACTION_VALUE] for now in (here, there))
    torch.testing.assert_close(theirs[sees], ours[sees], atol=1e-4, rtol=0.0)


@pytest.mark.parametrize(
    "turn",
    [each if each in GENERATORS else pytest.param(each, marks=pytest.mark.slow) for each in TURNS],
    ids=str,
)
def test_what_is_remembered_of_a_turned_world_is_turned(turn):
    """Three steps of a world and of the same world turned; frames change on the way."""
    preset = PRESETS["local"]
    env, rule = fighting(preset, n_worlds=24), HEURISTICS["local"](fighting(preset, n_worlds=24, steps=0))
    actors = [lively(Mlp(memory=16), fighting(preset, steps=0)) for _ in range(2)]
    faced, sees = [], True
    for _ in range(3):
        state = env.world_state.clone()
        here, there = (env.set_state(each).clone() for each in (state, turned_world(state, turn)))
        sees = sees & pulled(preset, state, 24)
        faced.append(orientation_of(seen(here), symmetries(preset)).index)
        ours, theirs = (actor(now)[LOGITS] for actor, now in zip(actors, (here, there)))
        fresh = lively(Mlp(memory=16), fighting(preset, steps=0))(here.clone())[LOGITS]
        expected = torch.empty_like(ours).index_copy_(2, turned_actions(torch.arange(11), turn), ours)
        torch.testing.assert_close(theirs[sees], expected[sees], atol=1e-5, rtol=0.0)
        env.step(rule(env.set_state(state)))
    assert ((faced[0] != faced[1]) | (faced[1] != faced[2]))[sees].any()
    assert not torch.allclose(ours[sees], fresh[sees], atol=1e-3), "the memory has a say"


def lively(model, env):
    """Return an actor whose weights tell, the same each time."""
    torch.manual_seed(0)
    actor = model.actor(signature(env))
    with torch.no_grad():
        for weight in actor.parameters():
            weight += 0.1 * torch.randn_like(weight)
    return actor.requires_grad_(False)


def test_networks_without_symmetry_say_something_else():
    """The check on the check."""
    here, there, sees = in_both(PRESETS["whole map"], (-1, 1, True))
    shape = signature(fighting(PRESETS["whole map"], steps=0))
    critic = Mlp(symmetry="none").critic(shape, central=True)
    assert not torch.allclose(critic(there)[VALUE][sees], critic(here)[VALUE][sees], atol=1e-3)


def test_a_mixer_says_the_same_of_a_turned_world():
    here, there, _ = in_both(PRESETS["whole map"], (-1, 1, True))
    env = fighting(PRESETS["whole map"], steps=0)
    said = {}
    for symmetry in ("canonical", "none"):
        model = Mlp(symmetry=symmetry)
        mixer = Dqn(mixer="qmix").build(env, model, 8).loss.mixer_network
        own = torch.arange(18.0).view(6, 3, 1)
        read = [model.canonical_batch(signature(env), restored=True)(now)[model.state_key] for now in (here, there)]
        said[symmetry] = [
            mixer(TensorDict({CHOSEN_ACTION_VALUE: own, model.state_key: state}, [6]))["chosen_action_value"]
            for state in read
        ]
    torch.testing.assert_close(*said["canonical"], atol=1e-4, rtol=0.0)
    assert not torch.allclose(*said["none"], atol=1e-3)


@pytest.mark.parametrize("model", [Mlp(), Mlp(sharing="none"), Cnn()], ids=["team", "none", "cnn"])
@pytest.mark.parametrize("name", PRESETS)
def test_a_batch_that_is_turned_once_is_learnt_from_as_if_it_were_turned_each_time(name, model):
    env = fighting(PRESETS[name])
    policy, critic = Ppo().policy(signature(env), model), model.critic(signature(env), central=True)
    with torch.no_grad():
        batch = policy(env.rollout(3, policy))
    kept = batch.clone()
    once = model.canonical_batch(signature(env))(batch)
    assert (batch == kept).all(), "what was collected stays as it is"
    assert (once[ACTION] != batch[ACTION]).any()
    assert OBSERVATION not in once.keys(True) and "state" not in once.keys()
    ours, theirs = over_canonical(policy).get_dist(once), policy.get_dist(batch)
    torch.testing.assert_close(ours.log_prob(once[ACTION]), theirs.log_prob(batch[ACTION]))
    torch.testing.assert_close(ours.entropy(), theirs.entropy())
    assert torch.equal(over_canonical(critic)(once.clone())[VALUE], critic(batch.clone())[VALUE])
    anew = model.canonical_batch(signature(env))(batch.exclude(ORIENTATION))
    for key in (ORIENTATION, ACTION, ACTION_MASK):
        assert torch.equal(anew[key], once[key]), "what no policy has turned is turned then"


def test_what_was_turned_when_it_was_acted_on_is_not_turned_again(monkeypatch):
    env = fighting(PRESETS["whole map"])
    learner = Ppo(minibatch_size=8, epochs=2).build(env, Mlp(), 24)
    counted, turn = [], Canonicalise.forward
    monkeypatch.setattr(Canonicalise, "forward", lambda self, td: counted.append(td.numel()) or turn(self, td))
    with torch.no_grad():
        batch = env.rollout(4, learner.explore, break_when_any_done=False)
    assert counted == [6] * 4
    learner.store(batch)
    for sample in learner.samples():
        learner.loss(sample)
    assert counted == [6] * 4 + [6], "besides acting, what the last step led to"


@pytest.mark.parametrize("learner", [Dqn(), Dqn(mixer="qmix"), Sac(), Ddpg(), Ddpg(central_critic=True)], ids=repr)
def test_a_replay_memory_keeps_canonical_entries_in_place_of_the_others(learner):
    env = fighting(PRESETS["whole map"])
    learner = replace(learner, warm_up=0, minibatch_size=8, updates=1, capacity=64).build(env, Mlp(), 24)
    with torch.no_grad():
        learner.store(env.rollout(4, learner.explore, break_when_any_done=False))
    (sample,) = learner.samples()
    for part in (sample, sample["next"]):
        keys = part.keys(True, True)
        assert ORIENTATION in keys and ("agents", "canonical_view") in keys
        assert "state" not in keys and not any(key[:2] == OBSERVATION for key in keys)


def test_a_policy_that_is_handed_out_writes_no_canonical_entries():
    env = fighting(PRESETS["whole map"], steps=0)
    shape = signature(env)
    policy = TrainedPolicy(Ppo().policy(shape, Mlp()), "sampled", shape)
    written = policy(env.reset()).keys(True, True)
    assert {ACTION, LOGITS} <= set(written) and not {ORIENTATION, ("agents", "canonical_view")} & set(written)
    assert set(policy.out_keys) <= set(written)


def test_a_policy_plays_where_entries_say_more_of_how_they_turn_than_they_did():
    env = fighting(PRESETS["whole map"], steps=0)
    here = signature(env)
    silent = here._replace(observation={name: each._replace(symmetry=None) for name, each in here.observation.items()})
    module = Ppo().policy(silent, Mlp(symmetry="none"))
    assert fitted(module, silent, here, fallback=8)(env.reset())[ACTION].shape == (6, 3)


def test_the_modules_that_learn_are_those_that_act():
    env = fighting(PRESETS["centred"], steps=0)
    policy = Ppo().policy(signature(env), Mlp())
    assert over_canonical(policy)[0] is policy.module[0][1]
    plain = Ppo().policy(signature(env), Mlp(symmetry="none"))
    assert over_canonical(plain) is plain


@pytest.mark.parametrize("name", PRESETS)
def test_every_entry_of_a_preset_says_how_it_turns(name):
    assert all(each.symmetry is not None for each in signature(fighting(PRESETS[name], steps=0)).observation.values())


@pytest.mark.parametrize(
    ("changed", "rule"),
    [
        ({"view": None}, r"does not say in its Space how it turns with the map, as view of shape \[11, 11, 11\]"),
        ({"status": None}, r"does not say in its Space how it turns with the map, as status"),
        ({"view": Planes(11), "picture": Planes(3)}, "no entry shows a target, such as fire"),
        ({"status": Vector((Part("scalar", tuple("abc")),))}, "no entry tells an agent's place"),
    ],
    ids=["view", "status", "no target", "no place"],
)
def test_observations_that_do_not_say_how_they_turn_are_read_as_they_are(make_small_env, changed, rule):
    shape = signature(make_small_env(2, observation=PRESETS["whole map"]))  # whose places are of the map
    entries = {
        name: entry._replace(symmetry=changed.get(name, entry.symmetry)) for name, entry in shape.observation.items()
    }
    other = shape._replace(observation=entries)
    with pytest.raises(ValueError, match=rf"^model\.symmetry must be none where .*{rule}.*, got canonical$"):
        Mlp().actor(other)
    assert Mlp(symmetry="none").actor(other) is not None


def test_what_was_stacked_or_cut_does_not_say_how_it_turns(make_small_env):
    view = ("agents", "observation", "view")
    env = TransformedEnv(make_small_env(2), CatFrames(N=4, dim=-3, in_keys=[view], out_keys=[view]))
    found = signature(env).observation
    assert found["view"].symmetry is None and found["picture"].symmetry is not None


def test_an_agent_turns_to_what_the_first_planes_show_and_else_to_the_next():
    """Two steps south in the near planes; in the far ones, where the agent is in the north-west corner, east."""
    near, far = torch.zeros(1, 2, 5, 5), torch.zeros(1, 1, 4, 4)
    near[0, 1, 4, 2], far[0, 0, 0, 3] = 1.0, 1.0
    declared = {
        "far": Planes(1, Target(0, order=1, in_middle=False, is_share=True)),
        "near": Planes(2, Target(1)),
        "own": Vector((Part("scalar", ("speed",)), Part("place", ("row", "column")))),
    }
    entries = {"far": far, "near": near, "own": torch.tensor([[7.0, 0.125, 0.125]])}
    assert orientation_of(entries, declared).index == framed(1, 1, True).index
    near.zero_()
    assert orientation_of(entries, declared).index == framed(1, 1, False).index


@pytest.mark.parametrize("name", ["centred", "local"])
def test_the_fire_lies_between_east_and_south_east(name):
    places = [[0, 0], [0, 9], [15, 15], [2, 15], [9, 11], [12, 2], [7, 4]]
    cells = torch.full((16, 16), 5)
    cells[8, 8] = 11
    state, world = drawn(cells.tolist(), places)
    entries = PRESETS[name](state, world, world.forecast(state))
    declared, found = symmetries(PRESETS[name]), 0
    what, channel = ("view", DEFAULT.index("fire_stage")) if name == "local" else ("picture", 0)
    if name == "centred":
        entries["view"].zero_()  # what an agent sees itself goes first, and is not in the middle of a block
    way = orientation_of(entries, declared)
    for plane in turned(entries[what], declared[what], way)[0, :, channel]:
        for row, column in (plane.nonzero() - len(plane) // 2).tolist():
            assert 0 <= row <= column
            found += 1
    assert found == (2 if name == "local" else len(places)), "what is within five cells, or all"


def framed(rows, columns, swapped):
    return Orientation(torch.tensor(4 * (rows < 0) + 2 * (columns < 0) + swapped))


def test_vectors_maps_and_actions_by_hand():
    # What is two rows up and five columns to the left of one: mirrored both, it is (2, 5) away.
    mirrored, half_turned = framed(-1, -1, False), framed(-1, 1, True)
    assert mirrored.offsets(torch.tensor([-2.0, -5.0])).tolist() == [2.0, 5.0]
    assert half_turned.offsets(torch.tensor([-5.0, 2.0])).tolist() == [2.0, 5.0]
    # Rows mirrored, 1 2 / 3 4 is 3 4 / 1 2; rows and columns swapped after that, 3 1 / 4 2.
    one = torch.tensor([[[1, 2], [3, 4]]])
    assert framed(-1, 1, False).planes(one).tolist() == [[[3, 4], [1, 2]]]
    assert half_turned.planes(one).tolist() == [[[3, 1], [4, 2]]]
    # Rows mirrored and then swapped with columns, east in the frame is what is north on the map, and south is east.
    entries = torch.arange(11)
    said = half_turned.by_action(entries, ACTIONS)
    assert (
        said[Action.EAST] == Action.NORTH and said[Action.SOUTH] == Action.EAST and said[Action.CLEAR] == Action.CLEAR
    )
    assert torch.equal(framed(1, 1, False).by_action(entries, ACTIONS), entries)


@pytest.mark.parametrize("n_actions", [10, 11])
def test_entries_by_action_come_back(n_actions):
    frame, entries, names = Orientation(torch.arange(8)), torch.randn(8, n_actions), ACTIONS[:n_actions]
    assert torch.equal(frame.by_action_back(frame.by_action(entries, names), names), entries)
    assert len({tuple(each) for each in frame.by_action(torch.arange(n_actions).expand(8, -1), names).tolist()}) == 8


def test_units_change_places_with_the_ways_to_hold_a_map():
    """From one frame to another they move as they do between what these are of any turned map, and come back."""
    frames, features = Orientation(torch.arange(8)), torch.randn(8, 16)
    assert torch.equal(frames.units_back(frames.units(features)), features)
    assert torch.equal(framed(1, 1, False).units(features), features)
    basis = torch.eye(2).expand(8, -1, -1)
    matrices = Orientation(torch.arange(8)[:, None].expand(-1, 2)).offsets(basis).transpose(-1, -2)

    def of_turned(frame, turn):
        return (matrices == matrices[frame] @ matrices[turn]).flatten(1).all(1).nonzero().item()

    def moved(first, then):
        return Orientation(torch.tensor(then)).units(Orientation(torch.tensor(first)).units_back(features[0])).tolist()

    for first, then, turn in itertools.product(range(8), repeat=3):
        assert moved(first, then) == moved(of_turned(first, turn), of_turned(then, turn))
    assert len({tuple(moved(0, then)) for then in range(8)}) == 8


def test_near_fires_count_for_more():
    """A fire one cell north pulls with 1 / (1 + 2)^3 = 0.037, one four cells south with 4 / (4 + 2)^3 = 0.019."""
    view = torch.zeros(1, 1, len(DEFAULT), 11, 11, dtype=torch.uint8)
    fire = view[0, 0, DEFAULT.index("fire_stage")]
    fire[4, 5] = fire[9, 5] = 51
    assert orientation_of({"view": view}, {"view": symmetries(Local())["view"]}).index == framed(-1, 1, True).index
    fire[9, 4] = fire[9, 6] = 204
    assert orientation_of({"view": view}, {"view": symmetries(Local())["view"]}).index == framed(1, 1, True).index, (
        "three of them are more, whatever their stage"
    )


def test_a_tie_is_a_tie_in_any_batch():
    """Fires at the corners of a diamond pull nowhere: north stays up, in one world and in a thousand."""
    picture = torch.zeros(1000, 1, 3, 8, 8)
    picture[:, :, 0, [1, 5, 3, 3], [3, 3, 1, 5]] = 0.3
    declared = symmetries(PRESETS["whole map"])
    entries = {
        "picture": picture,
        "status": torch.full((1000, 1, len(declared["status"].names)), 3.5 / 8),
        "view": torch.zeros(1000, 1, len(DEFAULT), 11, 11, dtype=torch.uint8),
    }
    for n_worlds in (1, 7, 1000):
        assert (orientation_of({name: entry[:n_worlds] for name, entry in entries.items()}, declared).index == 0).all()
    entries["view"][:, 0, DEFAULT.index("fire_stage"), 7, 4] = 51  # two cells down, one to the left
    assert (orientation_of(entries, declared).index == framed(1, -1, True).index).all(), (
        "what it sees itself goes first"
    )


def test_the_critics_map_faces_the_fire_and_is_about_what_happens(make_small_env):
    env = make_small_env(1, world=small_world(landscape=Perlin(size=16)))
    state = env.reset()["state"].zero_()
    state[0, 0, 2, 3] = 1.0  # fire
    state[0, 4, 10, 5] = state[0, 5, 12, 9] = 1.0  # a bulldozer, an aircraft: their middle is (11, 7)
    state[0, 1, 0, 0] = state[0, 1, 15, 15] = 0.5  # trees
    state[0, 7, :8, :8], state[0, 7, :8, 8:], state[0, 7, 8:, :8], state[0, 7, 8:, 8:] = 0.9, 0.4, 0.1, -0.3
    shown = canonical_state(state, STATE_SYMMETRY)[0]
    # The fire is nine rows up and four columns to the left: mirrored both, rows and columns swapped, it is at (12, 13),
    # the bulldozer at (10, 5), the aircraft at (6, 3). They fill rows 6 to 12 and columns 3 to 13, whose middles are 9
    # and 8: one row up, so that trees in the corner are lost above and come to row 14 below.
    assert shown[0].nonzero().tolist() == [[11, 13]]
    assert shown[4].nonzero().tolist() == [[9, 5]] and shown[5].nonzero().tolist() == [[5, 3]]
    assert shown[1].nonzero().tolist() == [[14, 15]]
    # A wind 0.1 to the east and 0.3 to the south: 0.1 to the west and 0.3 to the north, then swapped.
    quarters = shown[7].unflatten(1, (2, 8)).unflatten(0, (2, 8))[:, 0, :, 0]
    torch.testing.assert_close(quarters, torch.tensor([[0.9, 0.4], [-0.3, 0.1]]))
    assert (shown[7, 8:, :8] == shown[7, 8, 0]).all() and (shown[7, 8:, 8:] == shown[7, 8, 8]).all()


@pytest.mark.parametrize("down", [-4, -1, 0, 3])
@pytest.mark.parametrize("across", [-2, 0, 1])
def test_where_on_the_map_it_burns_makes_no_difference_to_the_critics_map(down, across):
    state = torch.zeros(8, 16, 16)
    state[0, 6, 5] = state[0, 9, 12] = 0.5  # fires
    state[1, 4:12, 3:14] = torch.randint(9, (8, 11)) / 8  # trees
    state[4, 4, 2] = 1.0  # a bulldozer
    moved = state.roll((down, across), (1, 2))  # of what is drawn, nothing comes in again on the other side
    shown = canonical_state(state, STATE_SYMMETRY)
    assert torch.equal(canonical_state(moved, STATE_SYMMETRY), shown)
    assert shown[0].nonzero().tolist() == [[7, 6], [10, 13]] and shown[4].nonzero().tolist() == [[5, 3]]
    assert shown.sum() == state.sum(), "nothing is lost here"


def test_the_critics_map_loses_no_fire_and_no_agent_and_shows_nothing_off_the_map():
    state = torch.rand(500, 8, 16, 16)
    for plane, share in ((0, 0.01), (4, 0.01), (5, 0.01)):
        state[:, plane] = (state[:, plane] < share).to(torch.float32)
    state[::2, :, 9:] = 0.0  # half of the maps are empty to the south
    state[:, 4, 1, 1] += 1.0
    shown = canonical_state(state, STATE_SYMMETRY)
    sums, before = shown.sum((-2, -1)), state.sum((-2, -1))
    for plane in (0, 4, 5):
        assert torch.equal(sums[:, plane], before[:, plane]), plane
    assert (sums[:, 1:4] <= before[:, 1:4] + 1e-3).all() and (sums[:, 1] < before[:, 1] - 1.0).any()


def test_worlds_really_are_turned():
    """The check on the check: north up, the eight maps differ."""
    env = fighting(Local())
    before = env.world_state.clone()
    views = [env.set_state(turned_world(before, turn))["agents", "observation", "view"] for turn in TURNS]
    assert not any(torch.equal(one, another) for one, another in itertools.combinations(views, 2))
