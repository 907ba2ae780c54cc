"""Radio: packets that set out in the loop of a step."""
