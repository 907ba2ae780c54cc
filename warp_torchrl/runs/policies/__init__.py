"""Trained policies: their folders, loading and acting."""
