"""The team: vehicles, their abilities, and what they know and hear."""
