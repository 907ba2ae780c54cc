"""Worlds whose firebreaks flames may breach, for what is asked of all worlds."""

WORLDS = {"breaches": ("scenario=skirmish", "mechanics.breach.flame_length=5.0")}
