"""Sensing: limited sight, smoke that hides fire, and how well a team watches."""
