"""Records: the map that an agent keeps of the fire, what each cell was when it was last seen, and when that was.

The mechanic that limits what agents know keeps them in the worlds, as ``records`` of its planes, under ``KNOWLEDGE``.

A record is ``(1 + step) * 64 + 32 firebreak + 16 ash + code``, int32. A cell that the agent never saw has the step -1
and the code that the map showed before the fire. Of two records of a cell the larger is the newer one.
"""

import torch
from torch import Tensor

from warp_torchrl.world.arrays.bytes import byte
from warp_torchrl.world.state.state import WorldState

_CODE, _ASH, _FIREBREAK, _KIND, _STEP = 15, 16, 32, 63, 6
"""Bits of a record: its code, ash, a firebreak, all three; and how many bits are below the step's."""
KNOWLEDGE = "sensing"
"""Name of the planes with the records."""
HALF_FRESH = 16.0
"""Steps after which what was seen is half as fresh as what is seen now."""


def kinds(state: WorldState) -> Tensor:
    """Return what each cell is now, uint8 [B, H, W]: the bits of a record below the step's."""
    ash = (state.cells == 0) & state.burned
    return state.cells + byte(ash) * _ASH + byte(state.firebreak) * _FIREBREAK


def recorded(kind: Tensor, step: Tensor) -> Tensor:
    """Return the records of what is seen now, int32 of the shape of the kinds.

    Args:
        kind: What each cell is taken for, as ``kinds`` tells it, uint8 [B, ...].
        step: The worlds' steps, int32 [B].
    """
    return ((_for_cells(step, kind) + 1) << _STEP) + kind


def known_codes(state: WorldState) -> Tensor:
    """Return the code that each agent knows of each cell, int32 [B, A, H, W].

    Raises:
        ValueError: If agents keep no records.
    """
    return codes(kept(state))


def records_of(state: WorldState) -> Tensor | None:
    """Return the agents' records, int32 [B, A, H, W]; None where they keep none."""
    return state.plane(KNOWLEDGE, "records")


def kept(state: WorldState) -> Tensor:
    """Return the agents' records, int32 [B, A, H, W].

    Raises:
        ValueError: If they keep none.
    """
    records = records_of(state)
    if records is None:
        raise ValueError("agents of these worlds know nothing of their own: sensing is full")
    return records


def codes(record: Tensor) -> Tensor:
    """Return the codes that records tell, int32 of their shape."""
    return record & _CODE


def read(record: Tensor) -> tuple[Tensor, Tensor, Tensor]:
    """Return the code that records tell, uint8, and whether the cell was ash, and a firebreak, bool; of their shape."""
    kind = (record & _KIND).to(torch.uint8)
    return kind & _CODE, (kind & _ASH) > 0, kind >= _FIREBREAK


def freshness(record: Tensor, step: Tensor) -> Tensor:
    """Return how fresh records are, h / (h + steps since) with h = 16; 0 of what was never seen. float32.

    Args:
        record: int32 [B, A, ...].
        step: The worlds' steps, int32 [B].
    """
    return torch.where(record > _KIND, HALF_FRESH / (HALF_FRESH + steps_since(record, step)), 0.0)


def steps_since(record: Tensor, step: Tensor) -> Tensor:
    """Return how old records are [steps], int32; step + 1 of what was never seen. The arguments are ``freshness``'s."""
    return _for_cells(step, record) + 1 - (record >> _STEP)


def in_sight(state: WorldState) -> Tensor | None:
    """Return the cells that each agent sees now, bool [B, A, H, W]; None where all agents see all."""
    records = records_of(state)
    return None if records is None else steps_since(records, state.step) == 0


def _for_cells(step: Tensor, cells: Tensor) -> Tensor:
    """Return the steps of worlds, [B], in a shape that goes with cells, [B, ...]."""
    return step.view(-1, *[1] * (cells.ndim - 1))
