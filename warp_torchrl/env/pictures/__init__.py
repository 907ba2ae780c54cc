"""Figures and map files: GeoTIFF, GeoJSON perimeters, pictures and animations."""
