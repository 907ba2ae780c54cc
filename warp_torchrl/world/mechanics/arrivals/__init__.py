"""Arrivals: vehicles that join and leave."""
