"""Agencies in play: networks of their own, evaluation, pictures, and the views of other libraries."""

import pytest
import torch
from tensordict import TensorDict

from tests.api.adapters.test_policy import policy_for
from tests.conftest import small_world
from tests.env.pictures.test_render import drawn
from tests.evaluation.test_episode_batch import alike, trained
from warp_torchrl.algorithms.held_batch import ADVANTAGE, with_advantages
from warp_torchrl.algorithms.ppo import Ppo
from warp_torchrl.api.adapters import parallel_env
from warp_torchrl.env import WildfireEnv
from warp_torchrl.env.pictures.render import render
from warp_torchrl.evaluation import play as play_module
from warp_torchrl.evaluation.episode_batch import fits
from warp_torchrl.evaluation.play import baselines_of, play
from warp_torchrl.models import AGENCY, LOGITS, Mlp, signature
from warp_torchrl.runs.policies.trained import TrainedPolicy
from warp_torchrl.world.mechanics.agencies.agencies import Lands, SeveralAgencies
from warp_torchrl.world.team.team import Team


def test_networks_are_chosen_by_the_agency_that_a_vehicle_serves(make_small_env):
    several = small_world(team=Team(n_agents=4), agencies=SeveralAgencies(own=1, lending="need"))
    env = make_small_env(3, several)
    actor, now = Mlp(sharing="agency", symmetry="none").actor(signature(env)), env.reset()
    assert now[AGENCY].tolist() == [[0, 1, 0, 1]] * 3
    own = [network(*(now[key] for key in signature(env).observation_keys())) for network in actor.module.networks]
    now[AGENCY] = lent = torch.tensor([[0, 1, 0, 1], [0, 1, 1, 1], [0, 1, 0, 0]])
    logits = actor(now)[LOGITS]
    for agent in range(4):
        for world in range(3):
            assert torch.equal(logits[world, agent], own[lent[world, agent]][world, agent])
    for central in (True, False):
        critic = Mlp(sharing="agency", symmetry="none").critic(signature(env), central)
        assert len(critic.module.network.networks if central else critic.module.networks) == 2


def test_networks_of_agencies_learn_from_their_own_vehicles_alone(make_small_env):
    env = make_small_env(3, small_world(team=Team(n_agents=4), agencies=SeveralAgencies()))
    model = Mlp(sharing="agency", actor_hidden=(16,), critic_hidden=(16,))
    learner = Ppo(minibatch_size=12).build(env, model, 12)
    with torch.no_grad():
        batch = env.rollout(4, learner.explore, break_when_any_done=False)
    made = with_advantages(learner.loss, batch, model.canonical_batch(signature(env), state=True))
    made[ADVANTAGE][..., 2:, :] = 0.0  # as if agency 1 had nothing to learn
    learner.loss.normalize_advantage = False
    learner.loss(made)["loss_objective"].backward()
    trained = {name: each.grad for name, each in learner.loss.named_parameters() if each.grad is not None}
    sums = [sum(grad.abs().sum() for name, grad in trained.items() if f"networks.{at}." in name) for at in (0, 1)]
    assert sums[0] > 0.0 and sums[1] == 0.0


def test_a_network_for_each_agency_needs_agencies_and_as_many_as_it_was_trained_with(make_small_env):
    with pytest.raises(ValueError, match=r"model\.sharing must be team, role or none where there is but one agency"):
        Mlp(sharing="agency").actor(signature(make_small_env(1)))

    def of(count):
        return make_small_env(1, small_world(team=Team(n_agents=4), agencies=SeveralAgencies(count=count)))

    policy = TrainedPolicy(Ppo().policy(signature(of(2)), Mlp(sharing="agency")), "sampled", signature(of(2)))
    assert policy.fitted(of(2)).module is policy.module
    with pytest.raises(ValueError, match="it has a network for each of 2 agencies, this environment has 3"):
        policy.fitted(of(3))
    with pytest.raises(ValueError, match="it has a network for each of 2 agencies, this environment has 1"):
        policy.fitted(make_small_env(1))


def test_agencies_play_as_step_by_step(monkeypatch):
    several = SeveralAgencies(own=1, lending="need", term=2)
    env = WildfireEnv(small_world(team=Team(n_agents=4), agencies=several), n_worlds=9)
    policy = trained(env, sharing="agency", symmetry="none")
    assert fits(env, policy)
    quick = play(env, policy, 5, "deterministic")  # a fresh policy's draws hardly depend on its networks
    monkeypatch.setattr(play_module, "fits", lambda env, policy: False)
    slow = play(env, policy, 5, "deterministic")
    assert alike(quick, slow) and {"saved_agency_0", "saved_agency_1"} <= slow.keys()


def test_a_line_parts_the_lands_of_agencies():
    state = drawn([[6, 6, 6], [6, 6, 6]])
    owner = torch.tensor([[[0, 0, 1], [0, 1, 1]]], dtype=torch.uint8)
    plain = render(state, None, scale=4)[0]
    lands = Lands(owner=owner, worth=torch.ones(1, 2), serves=torch.zeros(1, 1, dtype=torch.int64))
    image = render(state.with_planes("agencies", lands), None, scale=4)[0]
    differs = (image != plain).any(dim=-1)
    rows = ["".join(".#"[cell] for cell in row) for row in differs.int().tolist()]
    assert rows == [
        ".......##...",
        ".......##...",
        ".......##...",
        "....#####...",
        "...#####....",
        "...##.......",
        "...##.......",
        "...##.......",
    ]
    assert (image[differs] == torch.tensor([240, 241, 243], dtype=torch.uint8)).all()


def test_agencies_act_as_they_do_in_torchrl_and_alone():
    options = {"agencies.own": 1, "agencies.lending": "need", "agencies.term": 2}
    ours, policy = policy_for("spread_agencies", Mlp(actor_hidden=(32,), sharing="agency"), **options)
    theirs, act = parallel_env("spread_agencies", seed=3, **options), policy.numpy_policy()
    now, (seen, infos) = ours.reset(), theirs.reset()
    lent = []
    for _ in range(6):
        expected, actions = policy(now)["agents", "action"], act(seen, infos)
        assert list(actions.values()) == expected[0].tolist()
        assert {name: act(seen[name], infos[name]) for name in seen} == actions
        now = ours.step(TensorDict({"agents": {"action": expected}}, batch_size=[1]))["next"]
        lent.append(now["agents", "agency"][0].tolist())
        seen, _, _, _, infos = theirs.step(actions)
    assert lent[0] != lent[-1], "a vehicle was lent"
    _, policy = policy_for("agencies", Mlp(actor_hidden=(32,), sharing="agency"), observation="paper")
    theirs = parallel_env("agencies", seed=3, observation="paper")
    with pytest.raises(ValueError, match="network for each agency: observations must have self, which tells it"):
        policy.numpy_policy()(*theirs.reset())


def test_their_own_baseline_plays_beside_those_of_every_table():
    several = small_world(team=Team(n_agents=4), agencies=SeveralAgencies())
    assert baselines_of(several) == (*baselines_of(small_world()), "own_land")
