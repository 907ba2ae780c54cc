"""Agents that talk: who can move whom, and what is learnt from it."""

from dataclasses import dataclass

import pytest
import torch

from tests.conftest import small_world
from tests.models.canonical.test_canonical import (
    PRESETS,
    fighting,
    pulled,
    turned_actions,
    turned_world,
)
from tests.world.mechanics.there import needs
from warp_torchrl.algorithms.ppo import Ppo
from warp_torchrl.env.observation import Surroundings
from warp_torchrl.heuristics import HEURISTICS
from warp_torchrl.models import ACTION, LOGITS, OBSERVATION, RADIO, SENT, Cnn, Mlp, over_canonical, signature
from warp_torchrl.models.messages import Round
from warp_torchrl.models.signature import canonical_key
from warp_torchrl.runs.config.building import run_config
from warp_torchrl.runs.config.compose import compose_config
from warp_torchrl.runs.config.construction import ConfigError
from warp_torchrl.runs.config.plain_values import plain
from warp_torchrl.runs.config.saved_config import SavedConfig, restore
from warp_torchrl.world.team.team import Team

Radio = pytest.importorskip("warp_torchrl.world.mechanics.radio.radio").Radio
SMALL = {"actor_hidden": (16, 16), "critic_hidden": (16,), "messages": "graph", "message_size": 16}
MODELS = {
    "canonical": Mlp(**SMALL),
    "north up": Mlp(**SMALL, symmetry="none"),
    "two rounds": Mlp(**SMALL, message_rounds=2),
    "cnn": Cnn(**SMALL, channels=(4,)),
}
OWN = (*OBSERVATION, "status")


@pytest.fixture
def make_env(make_small_env):
    def make(n_worlds=4, n_agents=4, **radio):
        world = small_world(team=Team(n_agents=n_agents), mechanics=(Radio(carries="graph", **radio),))
        return make_small_env(n_worlds, world)

    return make


def lively(model, env, **changes):
    """Return an actor whose last layer and messages tell, the same each time."""
    torch.manual_seed(0)
    actor = model.actor(signature(env)._replace(**changes))
    with torch.no_grad():
        for weight in actor.parameters():
            weight += 0.2 * torch.randn_like(weight)
    return actor


def heard_in_a_line(now):
    """Let each agent hear the one before it, and no other."""
    now[RADIO] = torch.zeros_like(now[RADIO])
    for agent in range(1, now[RADIO].shape[1]):
        now[RADIO][:, agent, agent - 1, 0] = 1.0
    return now


def changed_by(actor, now, agent):
    """Return which agents' logits change with what one agent observes, bool [A]."""
    before, other = actor(now.clone())[LOGITS], now.clone()
    other[OWN][:, agent] += 0.5
    return (actor(other)[LOGITS] != before).flatten(2).any(-1).all(0)


@pytest.mark.parametrize("name", MODELS)
def test_an_agent_acts_on_what_it_sees_and_hears_and_on_nothing_else(make_env, name):
    env = make_env()
    actor, now = lively(MODELS[name], env), heard_in_a_line(env.reset())
    reach = MODELS[name].message_rounds
    for agent in range(4):
        expected = [agent <= other <= agent + reach for other in range(4)]
        assert changed_by(actor, now, agent).tolist() == expected


def test_alone_it_acts_as_if_nobody_were_there(make_env):
    env = make_env()
    actor, now = lively(MODELS["canonical"], env), env.reset()
    now[RADIO] = torch.zeros_like(now[RADIO])
    alone = actor(now.clone())[LOGITS]
    one = make_env(n_agents=1).reset()
    for key in [key for key in now.keys(True, True) if key[0] == "agents" and key in one.keys(True, True)]:
        one[key] = now[key][:, :1] if key != RADIO else now[key][:, :1, :1]
    torch.testing.assert_close(actor(one)[LOGITS], alone[:, :1])


def test_a_network_fits_a_team_of_any_size_and_order(make_env):
    env = make_env(n_agents=6)
    actor, now = lively(MODELS["two rounds"], make_env(n_agents=2)), env.reset()
    logits = actor(now.clone())[LOGITS]
    order = torch.tensor([3, 0, 5, 1, 2, 4])
    other = now.clone()
    for key in [key for key in now.keys(True, True) if key[0] == "agents"]:
        other[key] = now[key][:, order]
    other[RADIO] = other[RADIO][:, :, order]
    torch.testing.assert_close(actor(other)[LOGITS], logits[:, order])


def test_what_an_agent_says_is_learnt_from_what_the_others_do(make_env):
    env = make_env(n_agents=2)
    actor, now = lively(MODELS["canonical"], env), env.reset()
    actor(now)[LOGITS][:, 0].square().sum().backward()
    network = next(each for each in actor.modules() if isinstance(each, Round))
    assert network.send.weight.grad.abs().sum() > 0
    now = env.reset()
    now[RADIO] = torch.zeros_like(now[RADIO])
    actor.zero_grad()
    actor(now)[LOGITS][:, 0].square().sum().backward()
    assert not network.send.weight.grad.any(), "nobody heard it"


@pytest.mark.parametrize("turn", [(-1, 1, True), (1, -1, False), (-1, -1, True)], ids=str)
def test_a_team_that_talks_does_the_same_in_a_turned_world(turn):
    preset = PRESETS["whole map"]
    env = fighting(preset, n_worlds=24, mechanics=(Radio(carries="graph"),))
    state = env.world_state.clone()
    here, there = (env.set_state(each).clone() for each in (state, turned_world(state, turn)))
    sees = pulled(preset, state, 24).all(-1)
    assert sees.sum() >= 4
    for model in (Mlp(messages="graph", message_size=16, message_rounds=2), Mlp(messages="graph", symmetry="none")):
        actor = lively(model, env)
        ours, theirs = actor(here.clone())[LOGITS], actor(there.clone())[LOGITS]
        expected = torch.empty_like(ours).index_copy_(2, turned_actions(torch.arange(11), turn), ours)
        same = torch.allclose(theirs[sees], expected[sees], atol=1e-4)
        assert same == (model.symmetry == "canonical")
    actor = lively(Mlp(messages="graph"), env)
    silent = here.clone()
    silent[RADIO] = torch.zeros_like(silent[RADIO])
    assert not torch.allclose(actor(silent)[LOGITS], actor(here.clone())[LOGITS], atol=1e-3), "talk has a say"


@pytest.mark.parametrize("delay", [0, 2])
@pytest.mark.parametrize("name", MODELS)
def test_a_stored_batch_says_what_was_acted_on(make_env, name, delay):
    env, model = make_env(range=6.0, delay=delay), MODELS[name]
    if delay and model.message_rounds > 1:
        pytest.skip("messages come late in one round")
    policy = Ppo().policy(signature(env), model)
    with torch.no_grad():
        batch = env.rollout(5, policy)
    canonical = model.canonical_batch(signature(env), packed=True)(batch)
    if delay and model.symmetry == "canonical":
        assert SENT not in canonical.keys(True), "its canonical entries are kept"
        now, then = (canonical[canonical_key("view", sent)] for sent in (False, True))
        assert now.shape == then.shape, "packed alike"
    ours = over_canonical(policy).get_dist(canonical.reshape(-1)).log_prob(canonical[ACTION].flatten(0, 1))
    torch.testing.assert_close(ours, policy.get_dist(batch).log_prob(batch[ACTION]).flatten(0, 1))
    again = policy(batch.exclude(LOGITS).reshape(-1))[LOGITS]
    torch.testing.assert_close(again, batch[LOGITS].flatten(0, 1))


@pytest.mark.parametrize(
    ("overrides", "rule"),
    [
        (["model.memory=8"], r"model\.memory must be 0 where agents talk"),
        (["model.sharing=role"], r"model\.sharing must be team where agents talk"),
        (["model.message_size=12"], r"model\.message_size must be a multiple of 8"),
        (["algorithm=dqn"], r"model\.messages must be none or map where the algorithm replays"),
        (
            ["mechanics.radio.delay=1", "model.message_rounds=2"],
            r"model\.message_rounds must be 1 where messages come late, mechanics\.radio\.delay=1, got 2",
        ),
        (["mechanics.radio.delay=65"], r"mechanics\.radio\.delay must be in \[0, 64\], got 65"),
        (["mechanics.radio.delay=0.5"], r"mechanics\.radio\.delay must be a whole number, got 0\.5"),
        (["mechanics.radio.carries=none"], r"mechanics\.radio\.carries must be graph or both where networks talk"),
        (["imitation.demonstrations=somewhere"], r"imitation\.demonstrations must be null where agents talk"),
    ],
)
def test_what_cannot_be_is_refused_in_one_line(overrides, rule):
    with pytest.raises(ConfigError, match=rule):
        run_config(plain(compose_config("train", ["model.messages=graph", *overrides])))


def test_one_word_lets_the_environment_tell_whom_agents_hear():
    made = run_config(plain(compose_config("train", ["model.messages=graph", "mechanics.radio.range=5"])))
    assert RADIO in made.make_env(2, 0).reset().keys(True, True)
    silent = run_config(plain(compose_config("train", [])))
    assert RADIO not in silent.make_env(2, 0).reset().keys(True, True)


@pytest.mark.parametrize(("trained", "kept"), [("graph", "graph"), ("map", "none")])
def test_another_scenario_leaves_a_talking_team_its_radio(trained, kept):
    """... and takes the maps of a team that does not see all."""
    values = {"model": {"messages": trained}, "mechanics": {"radio": {"carries": trained}}}
    record = SavedConfig(choices={"scenario": "skirmish"}, values=values)
    config = restore(record, ["scenario=large", "mechanics.radio.range=7"])
    assert config.mechanics.radio == {"carries": kept, "range": 7} and config.team.n_agents == 8


@needs("sensing")
def test_maps_are_the_worlds_to_tell_and_any_learner_takes_them():
    told = run_config(plain(compose_config("train", ["scenario=search", "model.messages=map", "algorithm=dqn"])))
    env = told.make_env(2, 0)
    assert env.world.hearing.sends_maps and RADIO not in env.reset().keys(True, True)
    with pytest.raises(ConfigError, match=r"mechanics\.radio\.carries must be none or graph where agents see all"):
        run_config(plain(compose_config("train", ["model.messages=map"])))


@pytest.fixture
def make_late_env(make_small_env):
    def make(n_worlds=4, n_agents=4, delay=2, **options):
        world = small_world(team=Team(n_agents=n_agents), mechanics=(Radio(carries="graph", delay=delay),))
        return make_small_env(n_worlds, world, seed=0, **options)

    return make


LATE = {name: model for name, model in MODELS.items() if model.message_rounds == 1}
SENT_STATUS = (*SENT, "status")


def after_steps(env, steps):
    """What is shown after some steps east and south."""
    now = env.reset()
    for step in range(steps):
        now["agents", "action"] = torch.full_like(now["agents", "role"], 2 + 2 * (step % 2))
        now = env.step(now)["next"]
    return now.exclude(("agents", "reward"))


@pytest.mark.parametrize("name", LATE)
def test_a_late_message_is_what_its_sender_made_of_what_it_saw_then(make_late_env, name):
    env = make_late_env()
    actor, now = lively(LATE[name], env), heard_in_a_line(after_steps(env, 5))
    before = actor(now.clone())[LOGITS]

    def changed(whole, agent):
        other = now.clone()
        for entry in other[whole].values():  # as in another world, where the fire lies elsewhere: it turns otherwise
            entry[:, agent] = entry[:, agent].roll(1, 0)
        return (actor(other)[LOGITS] != before).flatten(2).any(-1).any(0).tolist()

    for agent in range(4):
        assert changed(OBSERVATION, agent) == [other == agent for other in range(4)], (
            "by what it sees now itself alone is moved"
        )
        assert changed(SENT, agent) == [other == agent + 1 for other in range(4)], "by what it saw then its hearer"


@pytest.mark.parametrize("name", LATE)
def test_a_team_that_has_stood_still_hears_late_what_it_hears_at_once(make_late_env, make_env, name):
    """The same networks, weights and arithmetic: where nothing has changed a delay makes no difference."""
    late, prompt = make_late_env(), make_env()
    now = after_steps(late, 4)
    for key in (OBSERVATION, SENT):
        now[key] = now[OBSERVATION].clone()
    ours, theirs = lively(LATE[name], late), lively(LATE[name], prompt)
    assert all(torch.equal(one, other) for one, other in zip(ours.parameters(), theirs.parameters(), strict=True))
    assert torch.equal(ours(now.clone())[LOGITS], theirs(now.exclude(SENT))[LOGITS])
    changed = now.clone()
    changed[SENT_STATUS] += 0.5
    assert not torch.equal(ours(changed)[LOGITS], ours(now)[LOGITS])


@dataclass(frozen=True, kw_only=True)
class Twitches(Surroundings):
    """As ``Surroundings``, but agent 0 observes something else in step 1."""

    def __call__(self, state, world, forecast):
        shown = super().__call__(state, world, forecast)
        shown["status"][:, 0] += 0.5 * (state.step == 1)[:, None]
        return shown


@pytest.mark.parametrize("delay", [1, 2, 4])
def test_what_an_agent_observes_moves_the_others_so_many_steps_later(make_late_env, delay):
    one, other = make_late_env(n_agents=2, delay=delay), make_late_env(n_agents=2, delay=delay, observation=Twitches())
    actor, moved = lively(LATE["canonical"], one), []
    for steps in range(7):
        ours, theirs = (actor(after_steps(env, steps))[LOGITS] for env in (one, other))
        moved.append((ours != theirs).flatten(2).any(-1).any(0).tolist())
    assert [step for step, (first, _) in enumerate(moved) if first] == [1], "itself at once"
    assert [step for step, (_, second) in enumerate(moved) if second] == [1 + delay]


def test_what_an_agent_said_is_learnt_from_what_the_others_do_later(make_late_env):
    env = make_late_env(n_agents=2)
    actor, now = lively(LATE["canonical"], env), after_steps(env, 4)
    actor(now)[LOGITS][:, 0].square().sum().backward()
    network = next(each for each in actor.modules() if isinstance(each, Round))
    assert network.send.weight.grad.abs().sum() > 0
    actor.zero_grad()
    actor(after_steps(env, 1))[LOGITS][:, 0].square().sum().backward()
    assert not network.send.weight.grad.any(), "nothing has arrived yet"


@pytest.mark.parametrize("turn", [(-1, 1, True), (1, -1, False)], ids=str)
def test_a_team_that_hears_late_does_the_same_in_a_turned_world(turn):
    """What was sent is turned as its sender saw it then, and heard as its receiver sees it now."""
    preset = PRESETS["whole map"]
    env = fighting(preset, n_worlds=24, mechanics=(Radio(carries="graph"),))
    then, rule = env.world_state.clone(), HEURISTICS["local"](env)
    for _ in range(4):
        env.step(rule(env._observe()))
    now = env.world_state.clone()

    def shown(turn):
        here, there = (turned_world(each, turn) for each in (now, then))
        sent, seen = env.set_state(there)[OBSERVATION].clone(), env.set_state(here).clone()
        seen[RADIO][..., 1:] *= 0.0
        seen[RADIO][..., 1:] += there.vehicles.position[:, None] - here.vehicles.position[:, :, None]
        return seen.set(SENT, sent)

    sees = pulled(preset, now, 24).all(-1) & pulled(preset, then, 24).all(-1)
    assert sees.sum() >= 4 and not torch.equal(now.vehicles.position, then.vehicles.position)
    for model in (Mlp(messages="graph", message_size=16), Mlp(messages="graph", symmetry="none")):
        actor = lively(model, env, is_late=True)
        ours, theirs = actor(shown((1, 1, False)))[LOGITS], actor(shown(turn))[LOGITS]
        expected = torch.empty_like(ours).index_copy_(2, turned_actions(torch.arange(11), turn), ours)
        assert torch.allclose(theirs[sees], expected[sees], atol=1e-4) == (model.symmetry == "canonical")


def test_networks_do_not_answer_what_comes_late(make_late_env):
    with pytest.raises(ValueError, match=r"model\.message_rounds must be 1 where messages come late .*, got 2"):
        Mlp(messages="graph", message_rounds=2).actor(signature(make_late_env()))
    assert Mlp(message_rounds=2).actor(signature(make_late_env())), "who is silent hears nothing"


def test_a_message_is_numbers_of_at_most_one_and_comes_with_its_place_in_sixteenths_of_a_cell():
    network, heard = Round(size=8, message=8, heads=2), []
    network.hear.register_forward_pre_hook(lambda module, given: heard.append(given[0]))
    features, upright = 50.0 * torch.eye(2, 8)[None], torch.zeros(1, 2, dtype=torch.int64)
    radio = torch.zeros(1, 2, 2, 3)
    radio[0, 0, 1] = torch.tensor([1.0, 16.0, -8.0])
    network(features, radio, upright)
    told = network.told(features, upright)
    assert told.abs().max() <= 1.0 and told.abs().max() > 0.99
    assert torch.equal(heard[0][0, 0, 1, :8], told[0, 1]) and heard[0][0, 0, 1, 8:].tolist() == [1.0, -0.5]


def test_who_hears_nobody_attends_to_nothing_and_who_hears_one_to_that_and_nothing():
    network = Round(size=8, message=8, heads=1)
    features, upright = torch.randn(1, 3, 8), torch.zeros(1, 3, dtype=torch.int64)
    radio = torch.zeros(1, 3, 3, 3)
    radio[0, 1, 0, 0] = 1.0
    after = network(features, radio, upright)
    assert torch.equal(after[0, [0, 2]], features[0, [0, 2]])
    told = torch.cat((network.told(features, upright)[0, 0], torch.zeros(2)))
    key, value = network.hear(told).chunk(2)
    weight = torch.sigmoid(network.ask(features[0, 1]) @ key / 8**0.5)  # a softmax over it and a key of zeros
    assert torch.allclose(after[0, 1], features[0, 1] + network.take(weight * value), atol=1e-5)
