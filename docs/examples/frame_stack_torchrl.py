"""Frame stacking with TorchRL's CatFrames, and a learner on top: it reads the shapes off the specs."""

import argparse

import torch
from torchrl.envs import CatFrames, TransformedEnv

from warp_torchrl import make_env
from warp_torchrl.algorithms.ppo import Ppo
from warp_torchrl.models import Mlp


def main(steps: int) -> None:
    """Show each agent its last four views, and take optimiser steps on what it then sees."""
    worlds, length = 16, 16
    view = ("agents", "observation", "view")  # [worlds, agents, channels, rows, columns]
    env = TransformedEnv(make_env("skirmish", n_worlds=worlds), CatFrames(N=4, dim=-3, in_keys=[view], out_keys=[view]))
    model = Mlp(symmetry="none")  # how stacked observations are turned, only their maker knows
    learner = Ppo(minibatch_size=64).build(env, model, frames_per_batch=worlds * length)

    for _ in range(max(1, steps // (worlds * length))):
        with torch.no_grad():
            batch = env.rollout(length, learner.explore, break_when_any_done=False)
        learner.store(batch)
        for sample in learner.samples():
            terms = learner.loss(sample)
            sum(terms[key] for key in learner.loss_keys).backward()
            learner.optimizer.step()
            learner.optimizer.zero_grad()
    print(f"views {list(env.reset()[view].shape)}, {terms['entropy']:.2f} nats of entropy left")


if __name__ == "__main__":
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--steps", type=int, default=100_000, help="world steps to train for")
    main(parser.parse_args().steps)
