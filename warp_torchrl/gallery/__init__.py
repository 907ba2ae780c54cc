"""Figures of the world, those of the paper and ours: ``python -m warp_torchrl.gallery``."""
