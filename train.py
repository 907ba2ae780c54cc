"""Train a team: ``python train.py [key=value ...]``, ``python train.py -m key=a,b`` sweeps. See ``conf/train.yaml``."""

import sys

from warp_torchrl.__main__ import run

if __name__ == "__main__":
    sys.exit(run("train"))
