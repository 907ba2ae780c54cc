"""The state of the world: its batches, its codes, and what is read off them."""
