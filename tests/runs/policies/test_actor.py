"""The actor of one vehicle chooses as the team's policy does, whatever networks, memories and messages it has."""

import pytest
import torch

from tests.world.mechanics.there import can_play
from warp_torchrl.models import ACTION, ACTION_MASK, AGENCY, RADIO, ROLE, SENT, signature
from warp_torchrl.models.signature import observation_key
from warp_torchrl.runs.checkpoint import CheckpointError
from warp_torchrl.runs.config.building import run_config
from warp_torchrl.runs.config.compose import compose_config
from warp_torchrl.runs.config.plain_values import plain
from warp_torchrl.runs.policies.actor import Actor
from warp_torchrl.runs.policies.trained import TrainedPolicy, scores

SMALL = ("landscape.size=12", "horizon=6", "model.actor_hidden=[16,16]", "model.critic_hidden=[16]", "team.n_agents=3")
FLOAT = ("model.dtype=float32",)
TALKS = ("model.messages=graph", "model.message_size=16", "mechanics.radio.carries=graph")
KINDS = {
    "one network": FLOAT,
    "north up": (*FLOAT, "model.symmetry=none"),
    "role": (*FLOAT, "model.sharing=role", "team.roles=[ugv,uav]"),
    "agent": (*FLOAT, "model.sharing=none"),
    "memory": (*FLOAT, "model.memory=16"),
    "memories of agents": (*FLOAT, "model.memory=8", "model.sharing=none"),
    "trust": (*FLOAT, "observation.advice=local", "observation.rules=true", "model.trust=1"),
    "convolutions": ("model=cnn", "model.channels=[4]"),
    "paper": (*FLOAT, "observation=paper"),
    "values": (*FLOAT, "algorithm=dqn"),
    "sac": (*FLOAT, "algorithm=sac"),
    "ddpg": (*FLOAT, "algorithm=ddpg"),
    "messages": (*FLOAT, *TALKS),
    "late messages": (*FLOAT, *TALKS, "mechanics.radio.delay=2"),
}


def lively(*overrides):
    """An untrained policy whose last layers tell, and its environment."""
    config = run_config(plain(compose_config("train", [*SMALL, *overrides])))
    env = config.make_env(5, 0)
    torch.manual_seed(0)
    policy = config.algorithm.policy(signature(env).bare(), config.model)
    with torch.no_grad():
        for weight in policy.parameters():
            weight += 0.3 * torch.randn_like(weight)
    return TrainedPolicy(policy.requires_grad_(False), "deterministic", signature(env).bare()), env


def observed(actor, shown, sent=False):
    """What each vehicle of a batch of teams observes, now or when it sent what arrives now, by the input's name."""
    keys = {name: key if not sent else (*SENT, *key[2:]) for name, key in actor.entries.items()}
    return {name: shown[key].flatten(0, 1) for name, key in keys.items()}


def given(actor, shown, memory):
    """The inputs of all vehicles, one a row."""
    worlds, agents = shown[ACTION_MASK].shape[:2]
    inputs = observed(actor, shown) | {"action_mask": shown[ACTION_MASK].flatten(0, 1)}
    if actor.index == "agent":
        inputs["agent"] = torch.arange(agents).repeat(worlds)
    elif actor.index:
        inputs[actor.index] = shown[{"role": ROLE, "agency": AGENCY}[actor.index]].flatten()
    if actor.memory_size:
        inputs["memory"] = memory
    if actor.message_size:
        inputs["radio"] = shown[RADIO].flatten(0, 1)
        nothing = torch.zeros(worlds * agents, agents, actor.message_size)
        said = inputs | {"messages": nothing} | (observed(actor, shown, sent=True) if actor.is_late else {})
        told = dict(zip(actor.writes, actor(*(said[name] for name in actor.reads)), strict=True))["message"]
        inputs["messages"] = told.view(worlds, 1, agents, -1).expand(-1, agents, -1, -1).flatten(0, 1)
    return [inputs[name] for name in actor.reads]


@pytest.mark.parametrize("name", KINDS)
def test_a_vehicle_acts_as_in_its_team(name):
    if not can_play(KINDS[name]):
        pytest.skip("its mechanic is not there")
    policy, env = lively(*KINDS[name])
    actor, shown = Actor(policy), env.reset()
    memory = torch.zeros(15, actor.memory_size)
    chosen = set()
    for _ in range(8):  # an episode has six steps: memories are forgotten on the way
        acted = policy(shown.clone())
        out = dict(zip(actor.writes, actor(*given(actor, shown, memory)), strict=True))
        memory = out.get("next_memory", memory)
        assert torch.equal(out["action"], acted[ACTION].flatten())
        mask = shown[ACTION_MASK].flatten(0, 1)  # Q-learning masks its values
        assert torch.allclose(out["logits"][mask], scores(acted).flatten(0, 1)[mask], atol=1e-5)
        chosen |= set(out["action"].tolist())
        _, shown = env.step_and_maybe_reset(acted)
    assert len(chosen) > 1


def test_rows_are_apart():
    policy, env = lively(*FLOAT)
    actor = Actor(policy)
    inputs = given(actor, env.reset(), None)
    whole, one = actor(*inputs), actor(*(each[3:4] for each in inputs))
    assert torch.allclose(one[1], whole[1][3:4], atol=1e-6) and one[0] == whole[0][3]


def test_it_leaves_the_policy_as_it_is():
    policy, _ = lively("model.dtype=bfloat16", "model.sharing=none")
    Actor(policy)
    assert policy.is_by_agent and {each.dtype for each in policy.modules() if hasattr(each, "dtype")} == {"bfloat16"}


@pytest.mark.skipif(not can_play(TALKS), reason="the radio is not there")
def test_several_rounds_of_messages_are_refused():
    policy, _ = lively(*TALKS, "model.message_rounds=2")
    with pytest.raises(CheckpointError, match="exchange 2 rounds of messages in a step: export takes one round"):
        Actor(policy)


def test_the_entries_have_the_names_of_the_observation():
    policy, _ = lively(*FLOAT)
    assert Actor(policy).entries == {name: observation_key(name) for name in ("status", "view")}
    assert Actor(lively("observation=paper")[0]).reads == ("observation", "action_mask")
