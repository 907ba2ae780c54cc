"""Worlds of limited sight, for what is asked of all worlds."""

TELLS_LATE = (
    "scenario=search",
    "mechanics.radio.carries=both",
    "mechanics.radio.delay=2",
    "mechanics.radio.loss=0.2",
)
WORLDS = {"tells late": TELLS_LATE}
