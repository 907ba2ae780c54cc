"""The team: vehicles, their abilities, their radio and their flight."""
