"""Imagined worlds beside the true ones: members that burn on their own, and how sightings weigh them."""
