"""Environments by name, and their views for other libraries."""
