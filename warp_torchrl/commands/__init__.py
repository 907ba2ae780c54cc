"""Commands and their sweeps."""
