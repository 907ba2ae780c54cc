"""Calibration: agreement of simulated with real fires, and parameters fitted to real fires."""
