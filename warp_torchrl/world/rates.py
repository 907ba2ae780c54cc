"""Chances of what trees do without a fire beside them, by cell code, in ticks of the automaton or of finer time.

A tick that is a k-th of the paper's has chances that come to the paper's in k of them.
"""

import math

from warp_torchrl.world.state import EMBER, OLDEST

Table = tuple[float, ...]


def in_a_tick(chance: float, ticks: int) -> float:
    """Return the chance in one tick of what has this chance in so many."""
    if ticks == 1 or chance == 1.0:
        return chance
    return -math.expm1(math.log1p(-chance) / ticks)


def growth(tau: float, ticks: int) -> Table:
    """Return p_grow of each cell code, exp(-age / S_max tau) in so many ticks (WARP-CA, growth)."""
    return tuple(
        in_a_tick(math.exp(-code / OLDEST * tau), ticks) if 1 <= code < OLDEST else 0.0 for code in range(EMBER + 1)
    )


def spontaneous_ignition(beta: float, cells: int, ticks: int) -> Table:
    """Return p_spont of each cell code, beta exp(10 age / S_max - 10) / (H W) in so many ticks, for H W cells.

    (WARP-CA, spontaneous ignition.)
    """

    def chance(code: int) -> float:
        return min(1.0, beta * math.exp(10.0 * code / OLDEST - 10.0) / cells)

    return tuple(in_a_tick(chance(code), ticks) if 1 <= code <= OLDEST else 0.0 for code in range(EMBER + 1))
