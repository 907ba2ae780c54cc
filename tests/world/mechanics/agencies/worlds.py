"""Worlds of agencies, for what is asked of all worlds, and runs, for what is asked of all trainings."""

LENDS = ("scenario=agencies", "agencies.own=1", "agencies.lending=need", "agencies.term=3")
WORLDS = {"lends": LENDS}
RUNS = {"serves": [*LENDS, "landscape.size=12", "horizon=10", "reward.cooperation=-0.5"]}
