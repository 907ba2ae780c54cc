"""The commands train and evaluate, and their sweeps."""
