"""Seeds of training worlds: no evaluation plays those worlds, and no two training seeds share one."""

WORLDS = 4096
"""Worlds that one training seed owns; a training of more has a range of its own."""
MOST_WORLDS = 2**20
"""Worlds that one training can have."""
SEEDS = 2**31
"""The largest training seed."""
FIRST_EVALUATED = 1_000_000
"""The evaluation's seeds go from here upward, as far as ``BEYOND_EVALUATION``."""
BEYOND_EVALUATION = 2**61
_OF_MANY = BEYOND_EVALUATION + 2**44
"""The first seed of trainings of more worlds than ``WORLDS``: those of fewer end below it."""
_BELOW_EVALUATION = FIRST_EVALUATED // WORLDS
"""Training seeds whose worlds lie below the evaluation's: those of the others lie beyond."""


def first_world_seed(training_seed: int, n_worlds: int = 1) -> int:
    """Return the seed of world 0 of a training; world i has that one + i.

    Args:
        training_seed: In 0..``SEEDS``.
        n_worlds: Worlds of the training, at most ``MOST_WORLDS``.
    """
    if n_worlds > WORLDS:
        return _OF_MANY + MOST_WORLDS * training_seed
    first = 0 if training_seed < _BELOW_EVALUATION else BEYOND_EVALUATION
    return first + WORLDS * training_seed
