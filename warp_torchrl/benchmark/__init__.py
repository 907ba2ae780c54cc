"""Benchmarks of speed, and of the difficulty of scenarios."""
