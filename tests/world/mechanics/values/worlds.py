"""Worlds with houses and measures of initial attack, for what is asked of all worlds."""

WORLDS = {
    "values": ("scenario=hetero", "mechanics.values.houses=12", "observation.features=[worth]", "goal=worth_saved"),
    "values by heat": (
        "scenario=skirmish",
        "fire=rate",
        "mechanics.values.points=[[3,4,10.0],[8,8,5.0]]",
        "mechanics.values.escape_area=2",
        "steps_per_tick=1",
        "goal=contained_at",
    ),
}
RUNS = {"values": ["scenario=skirmish", "mechanics.values.houses=6", "landscape.size=12", "horizon=10", "goal=escaped"]}
