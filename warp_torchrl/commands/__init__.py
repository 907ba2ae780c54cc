"""The two commands and their sweeps."""
