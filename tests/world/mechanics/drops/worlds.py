"""Worlds in which aircraft drop loads, for what is asked of all worlds."""

WORLDS = {
    "drops": ("scenario=hetero", "team.tank=2", "mechanics.drops.turnaround=2.0", "observation.features=[coverage]"),
    "drops retardant": (
        "scenario=skirmish",
        "fire=rate",
        "fire.minutes_per_tick=2.0",
        "team.roles=[uav]",
        "team.tank=1",
        "mechanics.drops.agent=retardant",
    ),
}
