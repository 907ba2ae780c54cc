"""Abilities and roles of a user's own: what a team makes of them."""

from collections.abc import Iterator
from dataclasses import dataclass

import pytest
import torch
from torchrl.envs import check_env_specs

from tests.conftest import small_world
from tests.world.drawing import draw, drawn
from warp_torchrl import load_policy, make_env
from warp_torchrl.entries import ADVICE
from warp_torchrl.env import WildfireEnv
from warp_torchrl.env.observation import CriticState, Surroundings
from warp_torchrl.heuristics import HEURISTICS
from warp_torchrl.models import ACTION, OBSERVATION
from warp_torchrl.system.shipped import policy_names
from warp_torchrl.world.state.role import ROLES, Role, add_role
from warp_torchrl.world.team.abilities import ABILITIES, Ability, AgentContext, Effect, ability
from warp_torchrl.world.team.team import Team

E, CLEAR = 2, 9


@pytest.fixture(autouse=True)
def sprinkler() -> Iterator[None]:
    """A role of two abilities that nobody else has: it wets the tree of its cell, and jumps along the diagonal."""

    @ability("sprinkle")
    @dataclass(frozen=True)
    class Sprinkle(Ability):
        actions = ("sprinkle",)

        def mask(self, now: AgentContext) -> torch.Tensor:
            return (now.at(now.state.cells, now.own_cell) > 0)[..., None]

        def act(self, now: AgentContext, choice: torch.Tensor) -> Effect:
            return Effect(self.mask(now)[..., 0], {"wet": 5})

    @ability("jump")
    @dataclass(frozen=True)
    class Jump(Ability):
        actions = ("jump_south_east", "jump_back")
        moves = True

        def mask(self, now: AgentContext) -> torch.Tensor:
            place = now.state.vehicles.position
            height, width = now.state.cells.shape[1:]
            room = (place[..., 0] < height - 1) & (place[..., 1] < width - 1)
            return torch.stack((room, (place > 0).all(-1)), dim=-1)

        def act(self, now: AgentContext, choice: torch.Tensor) -> Effect:
            possible = self.mask(now).gather(-1, choice[..., None])[..., 0]
            return Effect(possible, step=(1 - 2 * choice)[..., None].expand(*choice.shape, 2))

    add_role("sprinkler", Role("sprinkler", ("sprinkle", "jump")))
    yield
    del ROLES["sprinkler"], ABILITIES["sprinkle"], ABILITIES["jump"]


def team(n_agents: int = 2, **options: object) -> Team:
    return Team(n_agents=n_agents, roles=("ugv", "sprinkler"), **options)


@pytest.mark.parametrize("allow_stay", [True, False])
def test_further_actions_come_after_those_of_every_team(allow_stay: bool) -> None:
    every = Team(allow_stay=allow_stay).action_names
    assert team(allow_stay=allow_stay).action_names == (*every, "sprinkle", "jump_south_east", "jump_back")
    assert Team(roles=("uav",)).action_names == Team().action_names
    assert team().role_names == ("ugv", "uav", "sprinkler") and Team().role_names == ("ugv", "uav")


def test_a_mask_is_open_to_those_who_have_the_ability() -> None:
    state = draw("TT. ...", team=team(), at=[(0, 0), (0, 1)])
    bulldozer, sprinkler = team().action_mask(state, 14)[0].tolist()
    assert bulldozer[CLEAR] and not any(bulldozer[11:])
    assert not any(sprinkler[:10]) and sprinkler[11:] == [True, True, False]


@pytest.mark.parametrize("allow_stay", [True, False])
def test_each_acts_by_its_own_abilities(allow_stay: bool) -> None:
    crew, first = team(allow_stay=allow_stay), 11 if allow_stay else 10
    state = draw("TT. ...", team=crew, at=[(0, 0), (0, 1)])

    def act(*actions: int):
        return crew.act(state, torch.tensor([actions]), torch.tensor([True]), 14, 10)

    after, result = act(first, first)  # one of them cannot
    assert after.wet[0].tolist() == [[0, 5, 0], [0, 0, 0]] and drawn(after) == "TT. ..."
    assert result.credited.tolist() == [[False, True]] and after.vehicles.acts.tolist() == [[1, 1]]
    assert not result.extinguished.any() and not result.cleared.any()
    after, result = act(E, first + 1)
    assert after.vehicles.position.tolist() == [[[0, 1], [1, 2]]] and result.moved.all()
    after, result = act(first + 1, E)
    assert torch.equal(after.vehicles.position, state.vehicles.position) and not result.moved.any()
    assert after.vehicles.acts.tolist() == [[0, 0]]


def test_two_acts_at_one_tree_are_one() -> None:
    state = draw(".T. ...", team=team(4), at=[(0, 1)] * 4)
    after, result = team(4).act(state, torch.tensor([[E, 11, CLEAR, 11]]), torch.tensor([True]), 14, 10)
    assert after.wet[0, 0].tolist() == [0, 5, 0] and drawn(after) == ".T. ..."
    assert result.redundant.tolist() == [[False, False, True, True]]


@pytest.mark.parametrize("allow_stay", [True, False])
def test_a_team_s_own_roles_and_actions_come_last_in_self(allow_stay: bool) -> None:
    crew = team(3, allow_stay=allow_stay)
    env = WildfireEnv(small_world(team=crew), observation=Surroundings(identity=True), n_worlds=2)
    names = env.channel_names["status"]
    assert names == (
        *WildfireEnv(small_world(), observation=Surroundings(identity=True)).channel_names["status"],
        "role_sprinkler",
        "last_sprinkle",
        "last_jump_south_east",
        "last_jump_back",
    )
    now = env.reset()
    assert now[(*OBSERVATION, "status")][..., names.index("role_sprinkler")].tolist() == [[0.0, 1.0, 0.0]] * 2
    for action, name in enumerate(crew.action_names):
        now[ACTION] = torch.full((2, 3), action)
        own = env.step(now)["next"][(*OBSERVATION, "status")]
        last = [each for each in names if each.startswith("last_")]
        assert (own[..., names.index(f"last_{name}")] == 1.0).all()
        assert (own[..., [names.index(each) for each in last]].sum(-1) == 1.0).all()


def test_a_further_role_has_a_channel_of_its_own_in_the_state() -> None:
    env = WildfireEnv(small_world(team=team(3)), n_worlds=2)
    shown, places = env.reset()["state"], env.state_names
    plain = CriticState(small_world()).names
    assert places == (*plain[:6], "sprinkler", *plain[6:]) and shown.shape[1] == len(places)
    assert [shown[0, places.index(name)].sum().item() for name in env.role_names] == [2.0, 0.0, 1.0]
    check_env_specs(env)


@pytest.mark.parametrize(
    "name",
    [pytest.param(name, marks=[] if name in ("default", "single") else [pytest.mark.slow]) for name in policy_names()],
)
def test_a_shipped_policy_plays_beside_roles_and_actions_that_it_does_not_know(name: str) -> None:
    policy = load_policy(name, mode="deterministic")
    crew = "team.roles=[ugv,sprinkler,ugv]"
    scenario = "default" if name == "generalist" else name
    there = make_env(scenario, n_worlds=4, overrides=policy.overrides)
    here = make_env(scenario, n_worlds=4, overrides=[*policy.overrides, crew])
    now = there.reset()
    assert torch.equal(policy.fitted(there)(now.clone())[ACTION], policy(now.clone())[ACTION])
    alike, wide = now, here.reset()
    names = {env: env.channel_names["status"] for env in (there, here)}
    further = [place for place, name in enumerate(names[here]) if name not in names[there]]
    assert sum(not names[here][place].startswith(ADVICE) for place in further) == 4
    known = [place for place in range(len(names[here])) if place not in further]
    assert [names[here][place] for place in known] == list(names[there])
    wide[(*OBSERVATION, "status")][..., known] = alike[(*OBSERVATION, "status")]
    for entry in set(there.channel_names) - {"status"}:
        wide[(*OBSERVATION, entry)] = alike[(*OBSERVATION, entry)]
    wide["agents", "action_mask"][..., :11] = alike["agents", "action_mask"]
    assert torch.equal(policy.fitted(here)(wide)[ACTION], policy(alike)[ACTION])
    assert (here.rollout(20, policy.fitted(here), break_when_any_done=False)[ACTION] < 11).all()


def test_a_shipped_policy_plays_beside_them_on_numpy_too() -> None:
    policy = load_policy("default", mode="deterministic")
    env = make_env("default", n_worlds=3, overrides=[*policy.overrides, "team.roles=[ugv,sprinkler]"])
    now, fitted = env.reset(), policy.fitted(env)
    seen = {key: value.numpy() for key, value in now[OBSERVATION].items()}
    mask = now["agents", "action_mask"].numpy()
    team_seen = {
        name: {key: value[:, index] for key, value in seen.items()} | {"action_mask": mask[:, index]}
        for index, name in enumerate(env.agent_names)
    }
    acted = fitted.numpy_policy()(team_seen)
    assert [acted[name].tolist() for name in env.agent_names] == fitted(now)[ACTION].T.tolist()


@pytest.mark.parametrize("allow_stay", [True, False])
@pytest.mark.parametrize("name", HEURISTICS)
def test_heuristics_play_beside_them(name: str, allow_stay: bool) -> None:
    env = WildfireEnv(small_world(team=team(3, allow_stay=allow_stay)), n_worlds=3)
    action = env.rollout(4, HEURISTICS[name](env), break_when_any_done=False)[ACTION]
    assert name == "random" or (action < 11).all()
    if name == "noop":
        assert (env.world_state.vehicles.acts == 0).all() or not allow_stay
        assert not env.world_state.firebreak.any() and not env.world_state.wet.any()


@pytest.mark.slow
def test_a_compiled_step_knows_them_too() -> None:
    worlds = [WildfireEnv(small_world(team=team(3)), n_worlds=2, fuse=fuse) for fuse in (False, True)]
    for env in worlds:
        now = env.reset()
        for action in (11, 12, 13, 8):
            now[ACTION] = torch.full((2, 3), action)
            now = env.step(now)["next"]
    one, other = (env.world_state.leaves() for env in worlds)
    assert all(torch.equal(one[name], other[name]) for name in one)


def test_what_cannot_be_is_refused() -> None:
    add_role("sprinkler", ROLES["sprinkler"])  # the same again, as when a module is imported twice
    with pytest.raises(ValueError, match="ugv must be a new role with a new name, got truck"):
        add_role("ugv", Role("truck", ("move",)))
    with pytest.raises(ValueError, match="truck must be a new role with a new name, got uav"):
        add_role("truck", Role("uav", ("move",)))
    taken, new = (
        r"clear must be a new ability's name, warp_torchrl\.world\.team\.abilities has one",
        "with new actions, got",
    )
    for name, actions, line in (
        ("clear", ("fell",), taken),
        ("fell", ("clear",), f"fell must be an ability {new} clear"),
        ("fell", ("stay",), f"fell must be an ability {new} stay"),
        ("fell", (), f"fell must be an ability {new} none"),
    ):
        kind = type("Fell", (Ability,), {"actions": actions, "__module__": "elsewhere"})
        with pytest.raises(ValueError, match=line):
            ability(name)(kind)
    ROLES["boat"] = Role("boat", ("move", "sail"))
    try:
        with pytest.raises(ValueError, match=r"abilities of a role must be of move, .*, got sail"):
            Team(roles=("ugv", "boat"))
    finally:
        del ROLES["boat"]
