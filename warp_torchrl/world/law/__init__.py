"""The laws of fire: one readable statement each."""
