"""MAPPO in plain TorchRL, in 60 lines: nothing of this package but the environment."""

import argparse

import torch
from tensordict.nn import TensorDictModule
from torchrl.collectors import Collector
from torchrl.data import LazyTensorStorage, ReplayBuffer, SamplerWithoutReplacement
from torchrl.modules import MaskedCategorical, MultiAgentMLP, PopArtValueNorm, ProbabilisticActor
from torchrl.objectives.multiagent import MAPPOLoss

from warp_torchrl import make_env

SEEN = [("agents", "observation", name) for name in ("view", "status")]
NAMES = ("action", "sample_log_prob", "reward", "value", "advantage", "value_target")
LOGITS, MASK = ("agents", "logits"), ("agents", "action_mask")
KEYS = {name: ("agents", name) for name in NAMES}


class _Team(MultiAgentMLP):  # one network for all agents; what they view is in bytes
    def forward(self, view, own):
        return super().forward(torch.cat((view.flatten(-3) / 255.0, own), dim=-1))


def main(steps: int, worlds: int, length: int = 128) -> None:
    """Train two bulldozers."""
    torch.manual_seed(0)
    env = make_env("skirmish", n_worlds=worlds)
    *_, n_agents, n_actions = env.observation_spec[MASK].shape
    n_seen = sum(env.observation_spec[key].shape[2:].numel() for key in SEEN)
    net = {"n_agents": n_agents, "share_params": True, "depth": 2, "num_cells": 128}
    actor = TensorDictModule(_Team(n_seen, n_actions, centralized=False, **net), in_keys=SEEN, out_keys=[LOGITS])
    critic = TensorDictModule(_Team(n_seen, 1, centralized=True, **net), in_keys=SEEN, out_keys=[KEYS["value"]])
    drawn = {"distribution_class": MaskedCategorical, "return_log_prob": True, "log_prob_key": KEYS["sample_log_prob"]}
    policy = ProbabilisticActor(actor, in_keys={"logits": LOGITS, "mask": MASK}, out_keys=[KEYS["action"]], **drawn)
    loss = MAPPOLoss(policy, critic, entropy_coeff=0.005, value_norm=PopArtValueNorm(shape=1))
    loss.set_keys(**KEYS)
    loss.make_value_estimator(gamma=0.99, lmbda=0.95)  # GAE for each agent
    optimizer = torch.optim.Adam(loss.parameters(), lr=1e-3)
    frames = worlds * length
    buffer = ReplayBuffer(storage=LazyTensorStorage(frames), sampler=SamplerWithoutReplacement(), batch_size=1024)
    plan = {"frames_per_batch": frames, "total_frames": steps, "auto_register_policy_transforms": False}
    for number, batch in enumerate(Collector(env, policy, **plan), 1):
        loss.value_estimator(batch)  # [worlds, length]
        buffer.extend(batch.exclude("next", "info", "state").reshape(-1))  # in place of the batch before
        for sample in (sample for _ in range(4) for sample in buffer):
            terms = loss(sample)
            (terms["loss_objective"] + terms["loss_critic"] + terms["loss_entropy"]).backward()
            torch.nn.utils.clip_grad_norm_(loss.parameters(), 0.5)
            optimizer.step()
            optimizer.zero_grad()
        saved = batch["next", "info", "saved"][batch["next", "done"]]  # of the episodes that ended
        print(f"{number * frames} steps, {saved.mean():.1%} of the trees saved", flush=True)


if __name__ == "__main__":
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--steps", type=int, default=819_200, help="world steps to train for")
    parser.add_argument("--worlds", type=int, default=128, help="worlds that are played side by side")
    main(**vars(parser.parse_args()))
