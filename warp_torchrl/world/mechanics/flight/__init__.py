"""Flight: separation, batteries and drift of aircraft."""
