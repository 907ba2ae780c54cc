"""Fires without vehicles, and simulated futures."""
