"""Advice that a heuristic gives to agents."""

import pytest
import torch

from tests.world.mechanics.there import needs
from warp_torchrl.api.make import make_env
from warp_torchrl.entries import ADVICE
from warp_torchrl.env import WildfireEnv
from warp_torchrl.env.observation import Surroundings
from warp_torchrl.env.observation.advice import advised_actions
from warp_torchrl.heuristics import HEURISTICS, TEACHERS
from warp_torchrl.models import signature
from warp_torchrl.models.canonical.orientation import Orientation
from warp_torchrl.world.state.state import Action

NAMES = tuple(f"{ADVICE}{action.name.lower()}" for action in Action)


def env_of(scenario, adviser, *overrides, n_worlds=6):
    return make_env(
        scenario, n_worlds=n_worlds, overrides=["observation=surroundings", f"observation.advice={adviser}", *overrides]
    )


@pytest.mark.parametrize(
    ("scenario", "adviser"), [("water", "dispatch"), ("ring", "dispatch"), ("hetero", "coordinated")]
)
def test_advice_is_what_the_adviser_would_have_the_agent_do(scenario, adviser):
    env = env_of(scenario, adviser, "landscape.size=16")
    policy, shown, acts = HEURISTICS[adviser](env), env.reset(), set()
    for _ in range(12):
        action = policy(shown.clone())["agents", "action"]
        advised = shown["agents", "observation", "status"][..., -len(Action) :]
        assert torch.equal(advised.argmax(dim=-1), action) and torch.equal(advised.sum(dim=-1), torch.ones(6, 4))
        acts |= set(action.flatten().tolist())
        shown = env.step_and_maybe_reset(env.rand_action(shown))[1]
    assert len(acts) > 6, "moves and acts of many kinds were advised"


def test_a_team_that_takes_advice_saves_what_its_adviser_saves():
    env = env_of("skirmish", "dispatch", "horizon=48")
    other = make_env("skirmish", n_worlds=6, overrides=["horizon=48"])
    policy, led, alone = HEURISTICS["dispatch"](other), env.reset(), other.reset()
    for _ in range(48):
        advised = led["agents", "observation", "status"][..., -len(Action) :].argmax(dim=-1)
        led = env.step(led.set(("agents", "action"), advised))["next"]
        alone = other.step(policy(alone))["next"]
    assert torch.equal(led["info", "saved"], alone["info", "saved"]) and (led["info", "saved"] > 0.5).any()


def test_advice_comes_last_by_name_and_on_request_alone():
    def told_of(*overrides):
        return signature(make_env("water", n_worlds=1, overrides=["observation=surroundings", *overrides])).observation[
            "status"
        ]

    rules = ("observation.rules=true", "observation.water=true")
    assert told_of("observation.advice=greedy").names == (*told_of().names, *NAMES)
    assert told_of(*rules, "observation.advice=greedy").names == (*told_of(*rules).names, *NAMES)


def test_an_advised_move_turns_with_the_map():
    """On a map turned by a quarter to the right, what led north leads east."""
    part = signature(env_of("default", "dispatch", n_worlds=1)).observation["status"].symmetry.parts[-1]
    assert part.kind == "actions" and part.names == NAMES
    advised = torch.eye(len(NAMES))
    ways = Orientation(torch.arange(8)[:, None].expand(-1, len(NAMES)))
    turned = {tuple(each) for each in ways.by_action(advised.expand(8, -1, -1), NAMES).argmax(-1).tolist()}
    assert (2, 3, 4, 5, 6, 7, 0, 1, 8, 9, 10) in turned and (0, 7, 6, 5, 4, 3, 2, 1, 8, 9, 10) in turned
    assert len(turned) == 8 and all(each[8:] == (8, 9, 10) for each in turned)


def test_a_team_without_the_action_to_stay_has_its_place_empty():
    env = env_of("skirmish", "dispatch", "team.allow_stay=false")
    advised = env.reset()["agents", "observation", "status"][..., -len(Action) :]
    assert advised.shape[-1] == len(Action) and not advised[..., Action.STAY].any() and (advised.sum(dim=-1) == 1).all()


def test_who_advises_is_checked():
    assert "dispatch" in TEACHERS and "ring" not in TEACHERS
    with pytest.raises(ValueError, match=r"advice must be null or one of .*, got dispatcher: did you mean dispatch\?"):
        Surroundings(advice="dispatcher")
    with pytest.raises(ValueError, match="advice must be null or one of"):
        Surroundings(advice="ring")


@needs("sensing")
def test_an_adviser_knows_what_the_team_knows():
    env = env_of("search", "dispatch")
    env.rollout(20)
    state, adviser = env.world_state, HEURISTICS["dispatch"](env)
    mask = env.world.possible_actions(state)
    advised = advised_actions(state, env.world, "dispatch")
    assert torch.equal(advised, adviser.act(state, mask)) and not torch.equal(advised, adviser.choose(state, mask))


def test_steps_with_advice_are_neither_compiled_nor_recorded():
    with pytest.raises(ValueError, match="graph must be false with observation"):
        WildfireEnv(observation=Surroundings(advice="greedy"), graph=True)
    env = WildfireEnv(make_env("default").world, observation=Surroundings(advice="greedy"), n_worlds=256, fuse=True)
    assert env.why_eager == "a step with advice is not compiled"
