"""Calibration: how well fires alone agree with fires that happened, and parameters fitted to those."""
