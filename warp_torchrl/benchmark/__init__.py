"""Measures how fast the software is, and how hard its scenarios are."""
