"""The kinds of vehicle."""

from dataclasses import dataclass
from functools import lru_cache
from typing import NamedTuple

import torch
from torch import Tensor


class Role(NamedTuple):
    """What a kind of vehicle can do."""

    name: str
    stride: int  # cells a move
    flies: bool  # over lakes and fire
    clears: bool


ROLES = {
    "ugv": Role("bulldozer", stride=1, flies=False, clears=True),
    "uav": Role("uav", stride=2, flies=True, clears=False),
}
"""The roles of WARP-CA: ground vehicles (bulldozers) and aircraft."""
ROLE_NAMES = tuple(ROLES)


@dataclass(frozen=True, eq=False)
class RoleTable:
    """The roles of a team's agents and what they can do."""

    index: Tensor  # int64 [A], into ROLE_NAMES
    stride: Tensor  # int64 [A]
    flies: Tensor  # bool [A]
    clears: Tensor  # bool [A]


@lru_cache(maxsize=64)
def role_table(roles: tuple[str, ...], device: torch.device) -> RoleTable:
    """Return the table of the agents' roles, on a device."""
    kinds = [ROLES[role] for role in roles]
    return RoleTable(
        index=torch.tensor([ROLE_NAMES.index(role) for role in roles], device=device),
        stride=torch.tensor([kind.stride for kind in kinds], device=device),
        flies=torch.tensor([kind.flies for kind in kinds], device=device),
        clears=torch.tensor([kind.clears for kind in kinds], device=device),
    )
