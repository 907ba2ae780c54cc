"""Breach: flames that reach over firebreaks."""
