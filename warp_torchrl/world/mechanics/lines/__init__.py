"""Lines: how long vehicles take to clear a cell and to put out its fire, and the flames that they can work at."""
