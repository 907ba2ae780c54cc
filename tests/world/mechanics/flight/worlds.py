"""Worlds of aircraft with rules of flight, for what is asked of all worlds."""

WORLDS = {
    "flies apart": (
        "scenario=hetero",
        "mechanics.flight.battery=9",
        "mechanics.flight.separation=2",
        "mechanics.flight.drift=0.05",
        "reward.shaping=1.0",
    )
}
