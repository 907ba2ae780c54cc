"""Commands of the program ``warp``, and sweeps."""
