"""Worlds in which embers fall, for what is asked of all worlds."""

WORLDS = {
    "embers fall": ("scenario=embers", "observation.features=[embers]"),
    "embers by heat": (
        "scenario=embers",
        "fire=rate",
        "fire.minutes_per_tick=2.0",
        "mechanics.embers.chance=0.02",
        "mechanics.embers.firebrands.least_intensity=50",
        "mechanics.embers.firebrands.delay=4",
        "steps_per_tick=1",
    ),
}
RUNS = {"embers fall": ["scenario=embers", "landscape.size=12", "horizon=10", "steps_per_tick=2"]}
