"""Figures of the paper and of the fire laws: ``python -m warp_torchrl.gallery``."""
