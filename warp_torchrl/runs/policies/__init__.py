"""Trained policies: found, loaded, and played."""
