"""Embers: firebrands that the wind carries over rivers, roads and firebreaks, where they start new fires."""
