"""Configuration: composed from yaml, checked, and built."""
