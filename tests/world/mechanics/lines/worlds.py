"""Worlds in which lines take time, for what is asked of all worlds."""

WORLDS = {
    "lines": ("scenario=hetero", "mechanics.lines.means.ugv=crew1", "observation.features=[line]"),
    "lines by flames": (
        "scenario=skirmish",
        "fire=rate",
        "fire.minutes_per_tick=2.0",
        "mechanics.lines.gain=2.0",
        "mechanics.breach={}",
    ),
}
