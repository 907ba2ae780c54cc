"""Worlds of aircraft with retardant, for what is asked of all worlds."""

WORLDS = {
    "at fire": (
        "scenario=haksar",
        "team.n_agents=3",
        "team.tank=3",
        "team.approach=true",
        "observation=at_fire",
        "reward=round_fire",
    )
}
