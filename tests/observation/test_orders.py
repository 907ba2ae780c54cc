"""Orders that a dispatcher radios to agents."""

import pytest
import torch

from warp_torchrl.api import make_env
from warp_torchrl.env import WildfireEnv
from warp_torchrl.heuristics import HEURISTICS, TEACHERS
from warp_torchrl.models import signature
from warp_torchrl.models.canonical.orientation import Orientation
from warp_torchrl.observation import Surroundings
from warp_torchrl.symmetry import ORDER
from warp_torchrl.world.state import Action

NAMES = tuple(f"{ORDER}{action.name.lower()}" for action in Action)


def env_of(scenario, dispatcher, *overrides, n_worlds=6):
    return make_env(scenario, n_worlds=n_worlds, overrides=[f"observation.orders={dispatcher}", *overrides])


@pytest.mark.parametrize(
    ("scenario", "dispatcher"), [("water", "dispatch"), ("ring", "dispatch"), ("hetero", "coordinated")]
)
def test_an_order_is_what_the_dispatcher_would_have_the_agent_do(scenario, dispatcher):
    env = env_of(scenario, dispatcher, "landscape.size=16")
    policy, shown, acts = HEURISTICS[dispatcher](env), env.reset(), set()
    for _ in range(25):
        action = policy(shown.clone())["agents", "action"]
        order = shown["agents", "observation", "self"][..., -len(Action) :]
        assert torch.equal(order.argmax(dim=-1), action) and torch.equal(order.sum(dim=-1), torch.ones(6, 4))
        acts |= set(action.flatten().tolist())
        shown = env.step_and_maybe_reset(env.rand_action(shown))[1]
    assert len(acts) > 6, "moves and acts of many kinds were ordered"


def test_a_team_that_obeys_saves_what_its_dispatcher_saves():
    env = env_of("skirmish", "dispatch", "horizon=48")
    other = make_env("skirmish", n_worlds=6, overrides=["horizon=48"])
    policy, led, alone = HEURISTICS["dispatch"](other), env.reset(), other.reset()
    for _ in range(48):
        order = led["agents", "observation", "self"][..., -len(Action) :].argmax(dim=-1)
        led = env.step(led.set(("agents", "action"), order))["next"]
        alone = other.step(policy(alone))["next"]
    assert torch.equal(led["info", "saved"], alone["info", "saved"]) and (led["info", "saved"] > 0.5).any()


def test_orders_come_last_by_name_and_on_request_alone():
    def told_of(*overrides):
        return signature(make_env("water", n_worlds=1, overrides=[*overrides])).observation["self"]

    rules = ("observation.rules=true", "observation.water=true")
    assert told_of("observation.orders=greedy").names == (*told_of().names, *NAMES)
    assert told_of(*rules, "observation.orders=greedy").names == (*told_of(*rules).names, *NAMES)


def test_an_ordered_move_turns_with_the_map():
    """On a map turned by a quarter to the right, what led north leads east."""
    part = signature(env_of("default", "dispatch", n_worlds=1)).observation["self"].symmetry.parts[-1]
    assert part.kind == "actions" and part.names == NAMES
    order = torch.eye(len(NAMES))
    ways = Orientation(torch.arange(8)[:, None].expand(-1, len(NAMES)))
    turned = {tuple(each) for each in ways.by_action(order.expand(8, -1, -1), NAMES).argmax(-1).tolist()}
    assert (2, 3, 4, 5, 6, 7, 0, 1, 8, 9, 10) in turned and (0, 7, 6, 5, 4, 3, 2, 1, 8, 9, 10) in turned
    assert len(turned) == 8 and all(each[8:] == (8, 9, 10) for each in turned)


def test_a_team_without_the_action_to_stay_has_its_place_empty():
    env = env_of("skirmish", "dispatch", "team.allow_stay=false")
    order = env.reset()["agents", "observation", "self"][..., -len(Action) :]
    assert order.shape[-1] == len(Action) and not order[..., Action.STAY].any() and (order.sum(dim=-1) == 1).all()


def test_who_gives_orders_is_checked():
    assert "dispatch" in TEACHERS and "ring" not in TEACHERS
    with pytest.raises(ValueError, match=r"orders must be null or one of .*, got dispatcher: did you mean dispatch\?"):
        Surroundings(orders="dispatcher")
    with pytest.raises(ValueError, match="orders must be null or one of"):
        Surroundings(orders="ring")
    with pytest.raises(
        ValueError,
        match=r"observation\.orders must be null or one of .*follower.* where sight is limited, got dispatch",
    ):
        env_of("search", "dispatch")


def test_steps_with_orders_are_neither_compiled_nor_recorded():
    with pytest.raises(ValueError, match="graph must be false with observation"):
        WildfireEnv(observation=Surroundings(orders="greedy"), graph=True)
    env = make_env("default", n_worlds=256, overrides=["observation.orders=greedy"])
    assert WildfireEnv(env.world, observation=env.observation, fuse=True).why_eager is not None
