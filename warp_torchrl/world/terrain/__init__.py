"""Landscapes: noise, arrays and rasters, with elevation and fuel."""
