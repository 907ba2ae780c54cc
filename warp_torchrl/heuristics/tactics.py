"""Tactics of initial attack, in the trade's words (NWCG Glossary, PMS 205; Fireline Handbook, PMS 410-1).

A fire has a rear, where it is slowest, a head, where it is fastest, and a flank on either side of the axis between
them. Here the axis is the wind's; in calm air it points east, and the tactics still divide the fire among the agents.
"""

import torch
from torch import Tensor
from torch.nn.functional import max_pool2d

from warp_torchrl.heuristics.base import can_be_put_out, match_cells
from warp_torchrl.heuristics.coordinated import LAST
from warp_torchrl.heuristics.dispatch import Dispatch
from warp_torchrl.heuristics.paths import first_move, path_length
from warp_torchrl.world.arrays.geometry import grow
from warp_torchrl.world.arrays.listing import list_cells
from warp_torchrl.world.state.cells import is_burning, is_tree
from warp_torchrl.world.state.state import Action, WorldState
from warp_torchrl.world.state.worth import worth_of
from warp_torchrl.world.team.abilities import own_cell
from warp_torchrl.world.team.acting import is_second

_REACH = 12
"""Cells from an asset within which fire threatens it."""


def along_axis(state: WorldState) -> tuple[Tensor, Tensor]:
    """Return where each cell lies on the fire.

    Returns:
        The place along the axis from the fire's rear, 0, to its head, 1, float32 [B, H, W], less and more beyond them;
        and the place across it from the middle of the fire [cells], float32 [B, H, W], above 0 on the right flank as
        one looks to the head.
    """
    burning = is_burning(state.cells)
    wind = state.wind.mean(dim=(2, 3))
    speed = torch.sqrt(wind.square().sum(dim=1, keepdim=True))
    calm = torch.tensor([1.0, 0.0], device=wind.device)
    east, north = torch.where(speed > 0.1, wind / speed.clamp(min=1e-6), calm).unbind(dim=1)
    rows, columns = (torch.arange(side, dtype=torch.float32, device=wind.device) for side in burning.shape[1:])
    head = columns * east[:, None, None] - rows[:, None] * north[:, None, None]
    right = columns * north[:, None, None] + rows[:, None] * east[:, None, None]  # rows grow south
    first = head.masked_fill(~burning, torch.inf).flatten(1).amin(dim=1)
    last = head.masked_fill(~burning, -torch.inf).flatten(1).amax(dim=1)
    middle = (right * burning).flatten(1).sum(dim=1) / burning.flatten(1).sum(dim=1).clamp(min=1)
    length = (last - first).clamp(min=1.0)[:, None, None]
    return (head - first[:, None, None]) / length, right - middle[:, None, None]


class HeadAttack(Dispatch):
    """Direct attack at the head: the cells of the front that lie farthest down the wind come first."""

    weight = 100.0  # of the fire's length [cells of way]

    def value(self, state: WorldState) -> tuple[Tensor, Tensor]:
        """Return each cell's value [cells of way], float32 [B, H, W], and the fire front, bool [B, H, W]."""
        along, _ = along_axis(state)
        return self.weight * along, super().value(state)[1]


class FlankAttack(Dispatch):
    """Flanking attack: from the rear to the head along both flanks, every second agent along the left one."""

    weight = 100.0  # of the fire's length [cells of way]

    def value(self, state: WorldState) -> tuple[Tensor, Tensor]:
        """Return each cell's value [cells of way], float32 [B, H, W], and the fire's edge, bool [B, H, W]."""
        along, _ = along_axis(state)
        fire = can_be_put_out(state, self.world)
        edge = fire & grow(is_tree(state.cells))
        return -self.weight * along, torch.where(edge.flatten(1).any(1)[:, None, None], edge, fire)

    def worth(self, state: WorldState, value: Tensor, cells: Tensor) -> Tensor:
        """Return the value of cells for each agent, float32 [B, A, K]: the other flank comes last."""
        side = along_axis(state)[1].flatten(1).gather(1, cells)
        is_right = torch.arange(state.vehicles.position.shape[1], device=cells.device) % 2 == 1
        other = (side[:, None] > 0.0) != is_right[:, None]
        return super().worth(state, value, cells) - LAST / 2 * other


class AnchorAndFlank(FlankAttack):
    """Line along both flanks from an anchor at the fire's rear, one cell from the fire, until it meets at the head.

    Agents put out what they can reach, build line where they can do that alone, and else attack the flanks.
    """

    def choose(self, state: WorldState, mask: Tensor) -> Tensor:
        """Return the actions, int64 [B, A]."""
        attack = self._attack(state, mask)
        can = self.world.team.table(mask.device).can["clear"]
        line = self._line(state)
        cells, valid = list_cells(line)
        value, _ = self.value(state)
        gain = self.worth(state, value, cells) - path_length(state, self.world, cells)
        gain = gain.masked_fill(~(valid[:, None] & can[:, None]), -torch.inf)
        claims = match_cells(state, cells, gain, spacing=1, discount=2.0, taken=1000.0)
        own = own_cell(state)
        here = line.flatten(1).gather(1, own) & mask[..., Action.CLEAR]
        build = torch.where(
            here & ~is_second(own, here), int(Action.CLEAR), first_move(state, self.world, mask, claims)
        )
        builds = can & line.flatten(1).any(dim=1)[:, None] & ~mask[..., Action.EXTINGUISH]
        return torch.where(builds, build, attack)

    def _line(self, state: WorldState) -> Tensor:
        """Return the trees of the line that is to be built, bool [B, H, W]."""
        near = grow(is_burning(state.cells))
        return grow(near) & ~near & is_tree(state.cells) & (state.alpha > 0.0)


class PointProtection(Dispatch):
    """Protects what is worth most: fire comes first where it is near to assets; where none are, as ``Dispatch``."""

    weight = 100.0  # of the asset that is worth most, beside it [cells of way]

    def value(self, state: WorldState) -> tuple[Tensor, Tensor]:
        """Return each cell's value [cells of way], float32 [B, H, W], and the fire that can be put out."""
        value, front = super().value(state)
        told = state.plane("values", "worth")
        if told is None and state.landscape.layer("assets") is None:
            return value, front
        worth = worth_of(state) if told is None else told
        near = worth / worth.flatten(1).amax(dim=1).clamp(min=1e-9)[:, None, None]
        for _ in range(_REACH):
            near = torch.maximum(near, max_pool2d(near, 3, stride=1, padding=1) - 1.0 / _REACH)
        return value + self.weight * near, can_be_put_out(state, self.world)
