"""Worlds whose vehicles join and leave, for what is asked of all worlds."""

WORLDS = {
    "arrivals": (
        "scenario=hetero",
        "mechanics.arrivals.minutes={ugv:20,uav_0:3,uav_1:400}",
        "mechanics.arrivals.variation=0.3",
        "mechanics.arrivals.stays={uav:8}",
        "mechanics.arrivals.away={uav:4}",
        "mechanics.arrivals.minutes_per_tick=5",
    ),
    "arrivals by road": (
        "scenario=skirmish",
        "fire=rate",
        "mechanics.arrivals.stations={ugv:[-40,8]}",
        "steps_per_tick=1",
    ),
}
RUNS = {"arrivals": ["scenario=skirmish", "mechanics.arrivals.minutes={ugv:20}", "landscape.size=12", "horizon=10"]}
