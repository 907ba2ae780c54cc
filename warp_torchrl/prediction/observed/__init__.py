"""Prediction corrected by observations of the fire on the way."""
