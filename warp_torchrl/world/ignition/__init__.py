"""Where fires start, and how people intervene."""
