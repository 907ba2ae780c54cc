"""Fires without vehicles, and imagined ones."""
