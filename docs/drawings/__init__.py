"""Figures of the paper and of the fire laws: ``python docs/drawings``."""
