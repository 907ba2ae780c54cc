"""The names of the configuration: its groups, and the keys of its parts."""

OF_WORLDS = ("landscape", "wind", "fire", "team", "ignition", "sensing", "agencies")
"""Groups whose options make a world."""
ENVIRONMENT = (*OF_WORLDS, "observation", "reward")
"""Those that make an environment."""
COMPONENTS = (*ENVIRONMENT, "model", "algorithm", "collector", "curriculum", "mixture", "logger")
"""All groups whose options are classes."""
WORLD_KEYS = ("scenario", *OF_WORLDS, "mechanics", "steps_per_tick", "horizon", "cell_size", "action_masking")
"""What a scenario sets."""
COMMAND_KEYS = ("resume", "start_from", "debug", "policy", "overwrite", "maps", "maps_fires", "picture")
"""What the commands read themselves."""
