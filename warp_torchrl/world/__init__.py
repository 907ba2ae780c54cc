"""The world: fire, terrain, wind and vehicles as pure batched tensor functions (torch only)."""
