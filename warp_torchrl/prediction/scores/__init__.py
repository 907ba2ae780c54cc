"""Scores of predicted fires against observed ones: one definition of each."""
