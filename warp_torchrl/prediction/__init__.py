"""Prediction of fires without vehicles, in metres and minutes: maps and numbers."""
