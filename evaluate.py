"""Evaluate a checkpoint or a rule of thumb: ``python evaluate.py checkpoint=RUN`` or ``policy=local scenario=default``."""

from warp_torchrl.command import evaluate

if __name__ == "__main__":
    evaluate()
