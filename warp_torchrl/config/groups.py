"""The names of the configuration: its groups, and the keys of its parts."""

COMPONENTS = (
    "landscape",
    "wind",
    "fire",
    "team",
    "ignition",
    "sensing",
    "agencies",
    "observation",
    "reward",
    "model",
    "algorithm",
    "collector",
    "curriculum",
    "mixture",
    "logger",
)
"""Groups whose options are classes."""
ENVIRONMENT = COMPONENTS[: COMPONENTS.index("reward") + 1]
"""Those that make an environment."""
WORLD_KEYS = (
    "scenario",
    "landscape",
    "wind",
    "fire",
    "team",
    "ignition",
    "sensing",
    "agencies",
    "steps_per_tick",
    "horizon",
    "cell_size",
    "action_masking",
)
"""What a scenario sets."""
COMMAND_KEYS = ("resume", "start_from", "debug", "policy", "overwrite", "maps", "maps_fires", "picture")
"""What the commands read themselves."""
