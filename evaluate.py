"""Evaluate: ``python evaluate.py checkpoint=RUN``, or ``policy=local scenario=default``. See ``conf/evaluate.yaml``."""

from warp_torchrl.commands.command import evaluate

if __name__ == "__main__":
    evaluate()
