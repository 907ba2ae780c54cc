"""Trained policies on the views' numpy observations."""

from itertools import product

import numpy as np
import pytest
import torch
from tensordict import TensorDict

from tests.world.mechanics.there import needs
from warp_torchrl import make_env
from warp_torchrl.algorithms.dqn import Dqn
from warp_torchrl.algorithms.ppo import Ppo
from warp_torchrl.api.adapters import FireExtinguishingVectorEnv, gym_env, parallel_env
from warp_torchrl.models import Cnn, Mlp, signature
from warp_torchrl.runs.policies.trained import TrainedPolicy


def policy_for(scenario, model=None, algorithm=None, **options):
    env = make_env(scenario, n_worlds=1, seed=3, overrides=[f"{name}={value}" for name, value in options.items()])
    torch.manual_seed(1)
    module = (algorithm or Ppo()).policy(signature(env), model or Mlp(actor_hidden=(32,)))
    return env, TrainedPolicy(module.requires_grad_(False).eval(), "deterministic", signature(env))


def apart(quick, *values):
    """The given cases, and all others of the values, which are slow."""
    others = (each for each in product(*values) if each not in quick)
    return [*quick, *(pytest.param(*each, marks=pytest.mark.slow) for each in others)]


OBSERVATIONS = ("surroundings", "paper")


@pytest.mark.parametrize(
    ("sharing", "observation"),
    apart([("team", "paper"), ("role", "surroundings"), ("none", "paper")], ("team", "role", "none"), OBSERVATIONS),
)
def test_a_team_acts_as_it_does_in_torchrl(sharing, observation):
    model = Mlp(actor_hidden=(32,), sharing=sharing)
    ours, policy = policy_for("hetero", model, observation=observation)
    theirs, act = parallel_env("hetero", seed=3, observation=observation), policy.numpy_policy()
    now, (seen, infos) = ours.reset(), theirs.reset()
    chosen = []
    for _ in range(4):
        expected, actions = policy(now)["agents", "action"], act(seen, infos)
        assert list(actions.values()) == expected[0].tolist()
        assert list(actions) == theirs.agents and all(type(action) is int for action in actions.values())
        now = ours.step(TensorDict({"agents": {"action": expected}}, batch_size=[1]))["next"]
        seen, _, _, _, infos = theirs.step(actions)
        chosen += actions.values()
    assert len(set(chosen)) > 1


@needs("radio")
@pytest.mark.parametrize(
    ("delay", "layout", "observation"),
    apart(
        [(0, "dict", "surroundings"), (2, "flat", "surroundings"), (2, "dict", "paper"), (0, "flat", "paper")],
        (0, 2),
        ("dict", "flat"),
        OBSERVATIONS,
    ),
)
def test_a_team_that_talks_acts_as_it_does_in_torchrl(delay, layout, observation):
    model = Mlp(actor_hidden=(32,), messages="graph")
    options = {"mechanics.radio.carries": "graph", "mechanics.radio.range": 4, "mechanics.radio.delay": delay}
    options["observation"] = observation
    ours, policy = policy_for("default", model, **options)
    theirs, act = parallel_env("default", seed=3, layout=layout, **options), policy.numpy_policy()
    now, (seen, infos) = ours.reset(), theirs.reset()
    for _ in range(6):
        expected, actions = policy(now)["agents", "action"], act(seen, infos)
        assert list(actions.values()) == expected[0].tolist()
        now = ours.step(TensorDict({"agents": {"action": expected}}, batch_size=[1]))["next"]
        seen, _, _, _, infos = theirs.step(actions)
    first = {name: {"action_mask": info.get("action_mask")} for name, info in infos.items()}
    with pytest.raises(ValueError, match=f"info of bulldozer_0 must have radio{', sent' if delay else ''}, since"):
        act(seen, first)
    with pytest.raises(ValueError, match="must be of the whole team of 4 at once, got 1"):
        act({"bulldozer_0": seen["bulldozer_0"]}, infos)
    with pytest.raises(
        ValueError, match=r"talk by radio, which this environment does not have: mechanics\.radio\.carries=graph"
    ):
        policy.fitted(make_env("default", n_worlds=1))


@pytest.mark.parametrize("algorithm", [Ppo(), Dqn()], ids=lambda each: type(each).__name__)
@pytest.mark.parametrize("sharing", ["team", "role"])
def test_an_agent_may_ask_alone(sharing, algorithm):
    _, policy = policy_for("hetero", Cnn(actor_hidden=(32,), sharing=sharing), algorithm)
    env, act = parallel_env("hetero", seed=3), policy.numpy_policy()
    seen, infos = env.reset()
    together = act(seen, infos)
    assert {name: act(seen[name], infos[name]) for name in seen} == together
    assert {name: act({name: seen[name]})[name] for name in seen} == together


@pytest.mark.parametrize("observation", ["surroundings", "paper"])
def test_gymnasium_s_views_take_it_too(observation):
    _, policy = policy_for("single", observation=observation)
    act = policy.numpy_policy()
    one, many = gym_env(seed=8, observation=observation), FireExtinguishingVectorEnv(3, observation=observation)
    action = act(*one.reset())
    actions = act(*many.reset(seed=7))
    assert type(action) is int and actions.dtype == np.int64 and actions.shape == (3,) and actions[1] == action
    one.step(action), many.step(actions)


@pytest.mark.parametrize("observation", ["surroundings", "paper"])
@pytest.mark.parametrize("sharing", ["role", "none"])
def test_both_layouts_are_read_alike(sharing, observation):
    _, policy = policy_for("hetero", Mlp(actor_hidden=(32,), sharing=sharing), observation=observation)
    named, flat = (parallel_env("hetero", observation=observation, layout=layout) for layout in ("dict", "flat"))
    act, chosen = policy.numpy_policy(), set()
    (seen, infos), (vectors, _) = named.reset(seed=3), flat.reset(seed=3)
    for _ in range(6):
        actions = act(seen, infos)
        assert act(vectors) == actions
        seen, _, _, _, infos = named.step(actions)
        vectors, *_ = flat.step(actions)
        chosen |= set(actions.values())
    assert len(chosen) > 1


def test_batches_of_worlds_may_be_flat_too():
    _, policy = policy_for("single")
    act = policy.numpy_policy()
    named, flat = (FireExtinguishingVectorEnv(3, layout=layout) for layout in ("dict", "flat"))
    assert (act(*named.reset(seed=7)) == act(*flat.reset(seed=7))).all()


def test_nobody_acts_after_the_end():
    _, policy = policy_for("skirmish")
    assert policy.numpy_policy()({}) == {}


def test_masked_actions_are_never_chosen():
    _, policy = policy_for("single")
    seen, _ = gym_env(seed=0).reset()
    for action in range(11):
        mask = np.zeros(11, np.int8)
        mask[action] = 1
        assert policy.numpy_policy()({**seen, "action_mask": mask}) == action


def test_mistakes_are_told_in_one_line():
    _, policy = policy_for("hetero", observation="surroundings")
    _, of_paper = policy_for("hetero", Mlp(actor_hidden=(32,), sharing="role"), observation="paper")
    _, by_agent = policy_for("hetero", Mlp(actor_hidden=(32,), sharing="none"), observation="surroundings")
    seen, _ = parallel_env("hetero", observation="surroundings").reset()
    flat, infos = parallel_env("hetero", observation="paper").reset()
    one, vector = seen["uav_0"], parallel_env("hetero", observation="surroundings", layout="flat").reset()[0]["uav_0"]
    for call, message in [
        (lambda: policy.numpy_policy()({"view": one["view"]}), "must have action_mask, picture, status, got view"),
        (
            lambda: policy.numpy_policy()({**one, "status": one["status"][:5]}),
            r"status must be float32 of shape \[26\], got .* \[5\]",
        ),
        (lambda: policy.numpy_policy()({**one, "view": one["view"] / 255}), "view must be uint8 of shape .* float64"),
        (lambda: policy.numpy_policy()(flat["uav_0"]), "observation must be a dict of picture, status, view"),
        (
            lambda: policy.numpy_policy()({"uav_0": {**vector, "observation": vector["observation"][1:]}}),
            r"observation of uav_0 must be float32 of shape \[..., 2032\], got float32 \[2031\]",
        ),
        (
            lambda: policy.numpy_policy()({"observation": vector["observation"]}),
            "observation must have action_mask, got observation, picture, status, view",
        ),
        (lambda: of_paper.numpy_policy()(flat), "info of .* must have action_mask"),
        (lambda: of_paper.numpy_policy()(flat["uav_0"], infos["uav_0"]), "a network for each role"),
        (lambda: by_agent.numpy_policy()(one), "a network for each of .* agents: .* got 1"),
    ]:
        with pytest.raises(ValueError, match=message) as error:
            call()
        assert "\n" not in str(error.value)


@needs("radio")
def test_a_policy_that_hears_late_acts_in_worlds_of_any_delay():
    model = Mlp(actor_hidden=(32,), messages="graph")
    options = {"mechanics.radio.carries": "graph", "mechanics.radio.delay": 2}
    _, late = policy_for("default", model, **options)
    _, prompt = policy_for("default", model, **options | {"mechanics.radio.delay": 0})
    prompt.load_state_dict(late.state_dict())  # the same networks
    overrides = ["mechanics.radio.carries=graph", "team.tank=3", "team.roles=[ugv,scout]"]  # agents are shown more
    at_once, longer = (
        make_env("default", n_worlds=2, overrides=[*overrides, f"mechanics.radio.delay={n}"]) for n in (0, 5)
    )
    now = at_once.reset()
    for _ in range(6):
        ours, theirs = (each.fitted(at_once)(now.clone())["agents", "logits"] for each in (late, prompt))
        assert torch.equal(ours, theirs)
        now = at_once.step(at_once.rand_action(now))["next"]
    longer.rollout(8, late.fitted(longer))
    with pytest.raises(
        ValueError, match=r"messages come at once, and in this environment late: mechanics\.radio\.delay=0"
    ):
        prompt.fitted(longer)
    worlds = parallel_env("default", seed=3, **{"mechanics.radio.carries": "graph"})
    now = make_env("default", n_worlds=1, seed=3, overrides=["mechanics.radio.carries=graph"]).reset()
    here = late.fitted(worlds._worlds.env)
    assert [*here.numpy_policy()(*worlds.reset()).values()] == here(now)["agents", "action"][0].tolist()
