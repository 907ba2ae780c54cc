"""What a team believes of the fire: an ensemble of imagined fires that sightings correct."""
