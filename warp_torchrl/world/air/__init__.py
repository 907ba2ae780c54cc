"""Wind and weather of a world."""
