"""Worlds are the same whatever of torch's modes a program has set, in any order; who writes to outputs changes none."""

from contextlib import contextmanager

import pytest
import torch
from torchrl.envs.utils import step_mdp

from tests.env.scenarios import WORLDS, env_of
from tests.env.test_moves import POLICY, played, same
from warp_torchrl import load_policy, make_env
from warp_torchrl.heuristics import HEURISTICS


@contextmanager
def default_type(kind):
    before = torch.get_default_dtype()
    torch.set_default_dtype(kind)
    try:
        yield
    finally:
        torch.set_default_dtype(before)


@contextmanager
def deterministic():
    torch.use_deterministic_algorithms(True)
    try:
        yield
    finally:
        torch.use_deterministic_algorithms(False)


MODES = {
    "float64": lambda: default_type(torch.float64),
    "bfloat16": lambda: default_type(torch.bfloat16),
    "inference": torch.inference_mode,
    "meta": lambda: torch.device("meta"),
    "autocast": lambda: torch.autocast("cpu", dtype=torch.bfloat16),
    "deterministic": deterministic,
    "anomaly": lambda: torch.autograd.detect_anomaly(check_nan=True),
}


def equal(one, other):
    """Whether tensors are the same to the bit, and of the same type; what has no value is NaN."""
    return one.dtype == other.dtype and torch.allclose(one, other, rtol=0.0, atol=0.0, equal_nan=True)


def alike(one, other):
    """Whether worlds are the same to the bit."""
    theirs = other.leaves()
    return all(equal(leaf, theirs[name]) for name, leaf in one.leaves().items())


@pytest.mark.filterwarnings("ignore:Anomaly Detection")
@pytest.mark.parametrize("name", WORLDS)
def test_worlds_are_the_same_under_every_mode(maps, name):
    plain = env_of(name, maps)
    expected, state = played(plain), plain.world_state
    for mode in ("float64", "inference", *({"skirmish": MODES}.get(name, ()))):
        with MODES[mode]():
            env = env_of(name, maps)
            assert {spec.dtype for spec in env.reward_spec.values(True, True)} == {torch.float32}
            if mode == "meta":  # TorchRL's rollout makes tensors of its own, on the default device
                env.reset()
            else:
                found = played(env)
                assert same(found, expected), mode
                assert all(
                    a.dtype == b.dtype for a, b in zip(found[0].values(True, True), expected[0].values(True, True))
                )
        if mode != "meta":
            assert alike(env.world_state, state), mode
        assert not any(leaf.is_inference() for leaf in env.shared_state.leaves().values())


@pytest.mark.parametrize("way", ["reset", "maybe_reset", "step_and_maybe_reset"])
def test_worlds_are_reset_in_part_inside_and_outside_of_inference_mode(make_small_env, way):
    """By each of TorchRL's ways, after steps in one mode, itself in another, and stepped on."""
    ended = torch.tensor([[True], [False], [False], [True]])

    def marked(now):
        done = {key: ended.clone() for key in ("done", "terminated")}
        return now.clone().update(done)

    reset = {
        "reset": lambda env, now: env.reset(now.clone().set("_reset", ended)),
        "maybe_reset": lambda env, now: env.maybe_reset(marked(now)),
        "step_and_maybe_reset": lambda env, now: env.step_and_maybe_reset(POLICY(now))[1],
    }[way]

    def run(steps, resets):
        env = make_small_env()
        now = env.reset()
        for _ in range(2):
            with torch.inference_mode(steps):
                now = step_mdp(env.step(POLICY(now.clone())))
            with torch.inference_mode(resets):
                now = reset(env, now.clone())
        return now, env.shared_state, played(env, 3)

    seen, state, expected = run(False, False)
    for inside in ((True, False), (False, True), (True, True)):
        also, theirs, found = run(*inside)
        assert (seen == also).all() and alike(state, theirs) and same(found, expected), inside


def test_a_state_of_inference_mode_may_be_set_and_restored(make_small_env):
    env = make_small_env()
    with torch.inference_mode():
        env.rollout(3)
        state, saved = env.world_state, env.state_dict()
    some = torch.tensor([[True], [False], [False], [True]])
    for enter in (lambda: env.set_state(state), lambda: env.load_state_dict(saved)):
        enter()
        env.reset(env._observe().set("_reset", some))
        assert alike(env.world_state[torch.tensor([1, 2])], state[torch.tensor([1, 2])])


@pytest.mark.parametrize("name", [pytest.param("generalist", marks=pytest.mark.slow), "skirmish"])
def test_a_policy_acts_the_same_under_every_mode(name):
    expected = None
    for mode in (None, "float64", "bfloat16", "inference", "deterministic"):
        with MODES[mode]() if mode else torch.no_grad():
            policy = load_policy(name, "deterministic")
            env = make_env("skirmish", n_worlds=2, overrides=["landscape.size=16", *policy.overrides])
            acted = policy.fitted(env)(env.reset())
        logits = acted["agents", "logits"]
        expected = logits if expected is None else expected
        assert logits.dtype == torch.float32 and torch.equal(logits, expected), mode


@pytest.mark.parametrize("name", ["coordinated", "greedy", "ring", "dispatch", "rollout"])
def test_a_heuristic_chooses_the_same_under_every_mode(make_small_env, name):
    chosen = []
    for mode in ("no", "float64", "inference"):
        with MODES.get(mode, torch.no_grad)():
            env = make_small_env(2)
            now = env.reset()
            for _ in range(2):
                now = step_mdp(env.step(HEURISTICS[name](env)(now)))
            chosen.append(env.world_state.cells)
    assert all(torch.equal(each, chosen[0]) for each in chosen)


def spoil(shown):
    """Write to all that was shown, in its place."""
    for value in shown.values(True, True):
        value.zero_() if value.dtype == torch.bool else value.fill_(77)


@pytest.mark.parametrize("name", WORLDS)
def test_who_writes_to_outputs_changes_no_world_and_no_output(maps, name):
    clean, spoiled = env_of(name, maps), env_of(name, maps)
    now, seen = clean.reset(), spoiled.reset()
    assert (now == seen).all()
    some = torch.tensor([[True], [False], [True]])
    for step in range(5):
        spoil(seen)
        for leaf in (*spoiled.world_state.leaves().values(), *spoiled.tree_counts.leaves().values(), spoiled.seeds):
            leaf.zero_()
        action = POLICY(now.clone())["agents", "action"]
        given = now.clone().set(("agents", "action"), action.clone())
        now = clean.step(now.set(("agents", "action"), action))["next"]
        seen = spoiled.step(given)["next"]
        given["agents", "action"].fill_(3)
        assert (now == seen).all()
        if step == 2:
            spoil(seen)
            now = clean.reset(now.clone().set("_reset", some))
            seen = spoiled.reset(now.clone().set("_reset", some))
            assert (now == seen).all()
        assert alike(clean.shared_state, spoiled.shared_state)
        assert torch.equal(clean._episode_reward, spoiled._episode_reward) and torch.equal(clean.seeds, spoiled.seeds)
