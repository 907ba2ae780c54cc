"""What can be read from messages."""

import pytest
import torch

from tests.conftest import small_world
from warp_torchrl.algorithms.ppo import Ppo
from warp_torchrl.evaluation.probe import _Heard, _joined, _share, drawn_anew, probe
from warp_torchrl.models import Mlp, signature
from warp_torchrl.models.messages import Round
from warp_torchrl.runs.policies.trained import TrainedPolicy
from warp_torchrl.world.mechanics.sensing.sensing import Sight
from warp_torchrl.world.team.team import Team

Radio = pytest.importorskip("warp_torchrl.world.mechanics.radio.radio").Radio


def made(make_small_env, n_worlds=6, messages="graph", delay=0, **team):
    radio = Radio(carries=messages, delay=delay)
    world = small_world(team=Team(n_agents=2, **team), sensing=Sight(radius=3), mechanics=(radio,), horizon=20)
    env = make_small_env(n_worlds, world)
    model = Mlp(actor_hidden=(32,), messages=messages)
    policy = Ppo().policy(signature(env), model).requires_grad_(False)
    return env, TrainedPolicy(policy, "sampled", signature(env))


def heard(count, tells):
    torch.manual_seed(count)
    target = torch.randn(count) * 5.0 + 2.0
    noise = torch.randn(count, 4)
    messages = torch.cat((noise, (0.1 * target if tells else torch.randn(count))[:, None]), dim=-1)
    known = target.clone()
    known[::3] = torch.nan  # of those that know of none
    return _Heard(messages, {"it": known})


def test_what_messages_tell_is_read_from_them_and_what_they_do_not_tell_is_not():
    assert _share([heard(600, True), heard(500, True)], "it") > 0.98
    assert abs(_share([heard(600, False), heard(500, False)], "it")) < 0.05
    nothing = _Heard(torch.randn(5, 4), {"it": torch.full((5,), torch.nan)})
    assert _share([nothing, nothing], "it") != _share([nothing, nothing], "it"), "not a number"


def test_what_was_heard_in_all_steps_is_joined_and_of_one_step_is_that():
    first, second = heard(4, True), heard(3, False)
    both = _joined([first, second])
    assert torch.equal(both.messages, torch.cat((first.messages, second.messages)))
    assert torch.equal(both.known["it"].nan_to_num(), torch.cat((first.known["it"], second.known["it"])).nan_to_num())
    assert torch.equal(_joined([first]).messages, first.messages)


@pytest.mark.parametrize("delay", [pytest.param(0, marks=pytest.mark.slow), 3])
def test_a_row_for_each_thing_of_the_worlds_that_judge(make_small_env, delay):
    env, policy = made(make_small_env, delay=delay)
    found = {each.what: each for each in probe(policy, env, 7)}
    assert len(found) == 7 and all(each.messages > 0 for each in found.values())
    steps = found["its own row"].messages
    assert steps <= 3 * 2 * 20 and steps % 2 == 0
    assert found["rows to the nearest fire it knows of"].messages < steps
    again = {each.what: each for each in probe(policy, env, 7)}
    assert again == found


@pytest.mark.parametrize("delay", [pytest.param(0, marks=pytest.mark.slow), 3])
def test_an_agent_that_tells_where_it_is_is_heard_to(make_small_env, monkeypatch, delay):
    """... by the policy, and not by the one with other weights; what counts is what it says now, not what arrives."""
    env, policy = made(make_small_env, start="anywhere", delay=delay)

    def told(self, features, index):
        place = env.world_state.vehicles.position.to(torch.float32)
        return place if self is trained else torch.zeros_like(place)

    trained = next(each for each in policy.modules() if isinstance(each, Round))
    monkeypatch.setattr(Round, "forward", lambda self, features, radio, index, sent: features)
    monkeypatch.setattr(Round, "told", told)
    row = next(each for each in probe(policy, env, 3) if each.what == "its own row")
    assert row.trained > 0.99 and row.drawn_anew < 0.05


def test_weights_drawn_anew_are_others_and_the_policy_keeps_its_own(make_small_env):
    _, policy = made(make_small_env)
    before = {name: value.clone() for name, value in policy.state_dict().items()}
    other = drawn_anew(policy)
    assert all(torch.equal(value, before[name]) for name, value in policy.state_dict().items())
    key = next(name for name in before if "send.weight" in name)
    assert not torch.equal(other.state_dict()[key], before[key])
    assert torch.equal(drawn_anew(policy).state_dict()[key], other.state_dict()[key])


def test_what_cannot_be_probed_is_refused(make_small_env):
    env, silent = made(make_small_env, messages="none")
    with pytest.raises(ValueError, match="must be one whose agents talk"):
        probe(silent, env, 0)
    env, policy = made(make_small_env, n_worlds=1)
    with pytest.raises(ValueError, match="episodes must be at least 2"):
        probe(policy, env, 0)
