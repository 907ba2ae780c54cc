"""Values: what houses and other assets are worth after a fire, and what the fire cost."""
