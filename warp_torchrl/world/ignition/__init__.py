"""Ignition of fires, and interventions of people."""
