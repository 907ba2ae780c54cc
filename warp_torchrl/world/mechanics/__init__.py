"""Mechanics of the world, a folder each."""
