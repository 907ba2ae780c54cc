"""TorchRL to PettingZoo and back: the rewards are those of the environment itself, bit for bit."""

import argparse

import torch
from tensordict import TensorDict
from torchrl.envs import PettingZooWrapper

from warp_torchrl import make_env
from warp_torchrl.api.adapters import parallel_env


def main(steps: int) -> None:
    """Play random actions through PettingZoo, then the same actions in the same world without it."""
    theirs = PettingZooWrapper(parallel_env("skirmish"), return_state=True)
    rollout = theirs.rollout(steps, tensordict=theirs.reset(seed=7), auto_reset=False)  # an episode at most

    ours = make_env("skirmish", n_worlds=1, seed=7)
    ours.reset()
    rewards = []
    for action in rollout["bulldozer", "action"]:  # int64 [agents]; TorchRL groups agents by their names
        now = ours.step(TensorDict({"agents": {"action": action[None]}}, batch_size=[1]))["next"]
        rewards.append(now["agents", "reward"][0])

    equal = torch.equal(torch.stack(rewards), rollout["next", "bulldozer", "reward"])
    print(f"{len(rewards)} steps, the same rewards: {equal}")


if __name__ == "__main__":
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--steps", type=int, default=128, help="steps to play")
    main(parser.parse_args().steps)
