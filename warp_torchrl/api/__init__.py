"""Environments by name, and their adapters for other libraries."""
