"""Evaluate: ``python evaluate.py checkpoint=RUN``, or ``policy=local scenario=default``. See ``conf/evaluate.yaml``."""

import sys

from warp_torchrl.__main__ import run

if __name__ == "__main__":
    sys.exit(run("evaluate"))
