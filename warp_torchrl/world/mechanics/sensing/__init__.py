"""Sensing: sight, records of what was seen, smoke, and how well a team watches."""
