"""Seeds of training worlds: no evaluation plays those worlds, and no two training seeds share one."""

WORLDS = 4096
"""Worlds that one training seed owns."""
SEEDS = 2**31
"""The largest training seed."""
FIRST_EVALUATED = 1_000_000
"""The evaluation's seeds go from here upward, as far as ``BEYOND_EVALUATION``."""
BEYOND_EVALUATION = 2**61
_BELOW_EVALUATION = FIRST_EVALUATED // WORLDS
"""Training seeds whose worlds lie below the evaluation's: those of the others lie beyond."""


def first_world_seed(training_seed: int) -> int:
    """Return the seed of world 0 of a training seed; world i has that one + i."""
    first = 0 if training_seed < _BELOW_EVALUATION else BEYOND_EVALUATION
    return first + WORLDS * training_seed
