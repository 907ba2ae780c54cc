"""Drops: water and retardant from aircraft."""
