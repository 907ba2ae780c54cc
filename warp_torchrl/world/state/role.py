"""The kinds of vehicle: a table of roles by name, each a list of abilities."""

from collections.abc import Mapping
from dataclasses import dataclass
from typing import NamedTuple

import torch
from torch import Tensor
from torch.nn.functional import one_hot

from warp_torchrl.system.modes import kept
from warp_torchrl.world.arrays.geometry import offsets


class Role(NamedTuple):
    """What a kind of vehicle can do."""

    name: str  # of its agents, before their numbers
    abilities: tuple[str, ...]  # names of ``abilities.ABILITIES``
    stride: int = 1  # cells a move
    flies: bool = False  # over lakes and fire


ROLES: dict[str, Role] = {
    "ugv": Role("bulldozer", ("move", "extinguish", "clear")),
    "uav": Role("uav", ("move", "extinguish"), stride=2, flies=True),
}
"""All roles by name: ground vehicles (bulldozers) and aircraft of WARP-CA, and those that users add."""
PAPER_ROLES = tuple(ROLES)
"""The roles that observations of every team tell of."""
ROLES["scout"] = Role("scout", ("move",), stride=2, flies=True)
"""An aircraft that sees and cannot act (FireCommander's perception agents, Seraj et al. 2020)."""


def add_role(key: str, role: Role) -> None:
    """Add a role to the table, for ``team.roles``.

    Raises:
        ValueError: If the table has another role under that key or with that name.
    """
    taken = [each for known, each in ROLES.items() if known == key or each.name == role.name]
    if taken not in ([], [role]):
        raise ValueError(f"{key} must be a new role with a new name, got {role.name}")
    ROLES[key] = role


@dataclass(frozen=True, eq=False)
class RoleTable:
    """The roles of a team's agents, as tensors."""

    index: Tensor  # int64 [A], into ``role_names``
    one_hot: Tensor  # int64 [A, roles], the same
    stride: Tensor  # int64 [A]
    moves: Tensor  # int64 [A,2,8], (rows, columns) of the eight moves [cells]
    flies: Tensor  # bool [A]
    can: Mapping[str, Tensor]  # which agents have each ability of the table, bool [A]


def role_names(roles: tuple[str, ...]) -> tuple[str, ...]:
    """Return the roles that observations of a team tell of: the paper's, then the team's others."""
    return tuple(dict.fromkeys((*PAPER_ROLES, *roles)))


@kept(64)
def role_table(
    agents: tuple[str, ...], roles: tuple[str, ...], abilities: tuple[str, ...], device: torch.device
) -> RoleTable:
    """Return the table of agents' roles on a device.

    Args:
        agents: Role of each agent.
        roles: The roles that their indices count.
        abilities: Names of the abilities to tell of.
        device: Where the tensors are.
    """
    kinds = [ROLES[role] for role in agents]
    index = torch.tensor([roles.index(role) for role in agents], device=device)
    stride = torch.tensor([kind.stride for kind in kinds], device=device)
    return RoleTable(
        index=index,
        one_hot=one_hot(index, len(roles)),
        stride=stride,
        moves=offsets(device).T * stride[:, None, None],
        flies=torch.tensor([kind.flies for kind in kinds], device=device),
        can={name: torch.tensor([name in kind.abilities for kind in kinds], device=device) for name in abilities},
    )
