"""Train a team: ``python train.py [key=value ...]``, ``python train.py -m key=a,b`` sweeps. See ``conf/train.yaml``."""

from warp_torchrl.commands.command import train

if __name__ == "__main__":
    train()
