"""Maps for a geographic information system and for the eye: GeoTIFF, GeoJSON perimeters, figures."""
