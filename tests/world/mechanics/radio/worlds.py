"""Worlds of teams with a radio, for what is asked of all worlds."""

WORLDS = {
    "talks late": (
        "scenario=default",
        "mechanics.radio.carries=graph",
        "mechanics.radio.delay=2",
        "mechanics.radio.loss=0.2",
    )
}
