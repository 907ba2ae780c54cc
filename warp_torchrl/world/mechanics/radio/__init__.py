"""Radio: what agents tell each other, who hears whom, and when it arrives."""
