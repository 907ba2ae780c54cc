"""Curves and tables of many runs."""
