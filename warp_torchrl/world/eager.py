"""Reasons for which a step of worlds is not compiled."""

import torch

from warp_torchrl.system.compiler import vectors
from warp_torchrl.world.law.automaton import Automaton
from warp_torchrl.world.law.rate import RateFire

FEW_CELLS = 2**15
"""Of all worlds; a compiled step of so many gains on any CPU."""


def why_eager(fire: Automaton, device: torch.device, cells: int) -> str | None:
    """Return why a step of worlds is not compiled, though it was asked for; None where it is.

    Under law ``rate`` a step took minutes to compile, and a CPU's band is faster without. On CPUs whose vectors are
    shorter than those of AVX-512 Inductor reads and writes bytes and whole numbers one by one, so that compiled code
    gains only where a step has so few cells that most of its time is the calls of its operations.

    Args:
        fire: The automaton.
        device: Where the worlds live.
        cells: B * H * W.
    """
    if isinstance(fire, RateFire):
        return "a step under a law with a clock is not compiled"
    if device.type != "cpu" or vectors() == "AVX512" or cells <= FEW_CELLS:
        return None
    return f"a step of {cells} cells is faster eager with {vectors()}, and is not compiled"
