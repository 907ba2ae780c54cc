"""Agencies as groups of agents in TorchRL's sense."""

import pytest
import torch
from tensordict.nn import TensorDictModule, TensorDictSequential
from torch import nn
from torchrl.envs import check_env_specs, set_exploration_type
from torchrl.modules import MaskedCategorical, ProbabilisticActor
from torchrl.objectives import ClipPPOLoss, ValueEstimators

from warp_torchrl import make_env
from warp_torchrl.env import GroupedEnv


def grouped(n_worlds=3, *overrides):
    return GroupedEnv(make_env("agencies", n_worlds=n_worlds, seed=2, overrides=list(overrides)))


@pytest.mark.parametrize("own", [0, 1, 2])
def test_specs_are_those_of_the_groups(own):
    env = grouped(2, f"agencies.own={own}")
    check_env_specs(env)
    expected = {0: ["pool"], 1: ["agency_0", "agency_1", "pool"], 2: ["agency_0", "agency_1"]}[own]
    assert list(env.group_map) == expected and sum(map(len, env.group_map.values())) == 4
    assert env.action_keys == [(name, "action") for name in expected]
    assert env.reward_keys == [(name, "reward") for name in expected]
    assert "agents" not in env.reset().keys()


def test_groups_play_the_game_of_their_team():
    env, whole = grouped(3, "agencies.own=1"), make_env("agencies", n_worlds=3, seed=2, overrides=["agencies.own=1"])
    seen, team = env.reset(), whole.reset()
    for step in range(6):
        action = torch.randint(0, 11, (3, 4), generator=torch.Generator().manual_seed(step))
        for name, members in (("agency_0", [0]), ("agency_1", [1]), ("pool", [2, 3])):
            assert torch.equal(seen[name, "observation", "view"], team["agents", "observation", "view"][:, members])
            assert torch.equal(seen[name, "agency"], team["agents", "agency"][:, members])
            seen[name, "action"] = action[:, members]
        seen, team = env.step(seen)["next"], whole.step(team.set(("agents", "action"), action))["next"]
        joined = torch.cat([seen[name, "reward"] for name in ("agency_0", "agency_1", "pool")], dim=1)
        assert torch.equal(joined, team["agents", "reward"])


def test_each_group_learns_by_a_loss_of_torchrl_of_its_own():
    env = grouped(4, "observation=surroundings")

    def network(out):
        return nn.Sequential(nn.Flatten(-3, -1), nn.LazyLinear(8), nn.Tanh(), nn.Linear(8, out))

    actors, losses = {}, {}
    for name in env.group_map:
        seen = [(name, "observation", "picture")]

        class Read(nn.Module):
            def __init__(self, out):
                super().__init__()
                self.network = network(out)

            def forward(self, picture):
                return self.network(picture.float())

        actors[name] = ProbabilisticActor(
            TensorDictModule(Read(11), in_keys=seen, out_keys=[(name, "logits")]),
            in_keys={"logits": (name, "logits"), "mask": (name, "action_mask")},
            out_keys=[(name, "action")],
            distribution_class=MaskedCategorical,
            return_log_prob=True,
            log_prob_key=(name, "log_prob"),
        )
        critic = TensorDictModule(Read(1), in_keys=seen, out_keys=[(name, "value")])
        critic(actors[name](env.reset()))
        losses[name] = ClipPPOLoss(actors[name], critic)
        losses[name].set_keys(
            action=(name, "action"), sample_log_prob=(name, "log_prob"), value=(name, "value"),
            reward=(name, "reward"), done=(name, "done"), terminated=(name, "terminated"),
        )  # fmt: skip
        losses[name].make_value_estimator(ValueEstimators.GAE, gamma=0.99, lmbda=0.95)
    with set_exploration_type(None), torch.no_grad():
        data = env.rollout(8, TensorDictSequential(*actors.values()), break_when_any_done=False)
    for name, loss in losses.items():
        for flag in ("done", "terminated"):
            shape = data["next", name, "reward"].shape
            data["next", name, flag] = data["next", flag].unsqueeze(-1).expand(shape)
        with torch.no_grad():
            networks = {"params": loss.critic_network_params, "target_params": loss.target_critic_network_params}
            loss.value_estimator(data, **networks)
        terms = loss(data.reshape(-1))
        total = terms["loss_objective"] + terms["loss_critic"] + terms["loss_entropy"]
        total.backward()
        assert all(each.grad.isfinite().all() and each.grad.abs().sum() > 0 for each in actors[name].parameters())
        others = [each for other in actors if other != name for each in actors[other].parameters()]
        assert all(each.grad is None for each in others) or name != next(iter(actors)), "it learns from its own alone"
